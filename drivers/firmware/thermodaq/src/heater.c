#include "heater.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <util/atomic.h>

#include "phase_table.h"

/* A gate still on at the zero crossing would fire the triac for the whole next half wave, so it
 * goes off this long before; and none fires earlier than this after the crossing, where the
 * voltage is too small to hold the triac. */
#define GATE_MARGIN (GATE_HZ / 2000UL) /* 0.5 ms */

/* The smallest power a gate at its latest instant can stand for. */
#define PHASE_LEAST (FULL_POWER / 100U)

/* Longest stretch the 8-bit timer is set to at once, and the shortest that it cannot miss. */
#define STRETCH_MAX 250U
#define STRETCH_MIN 16U

/* Without a crossing for this many half waves the input counts as open. */
#define MISSING_HALVES 3U

/* Crossings in a row, all at the right distance, before the input is believed. */
#define TRUSTED_CROSSINGS 8U

static struct configuration setup;
static uint16_t half_wave; /* in counts of the gate timer, as are the delays */

static volatile uint16_t power;
static volatile uint16_t left_ms; /* of the command's validity; 0: none in force */
static volatile uint8_t cut = CUT_RESET;

static uint16_t accumulator; /* Bresenham over cycles */
static uint16_t fire_delay;  /* phase angle: from the crossing to the gate; 0: stay off */
static uint16_t gate_left;   /* until the gate changes, beyond the stretch that is running */
static uint16_t gate_delay;  /* of this half wave: a new command must not move its end */
static bool gate_open;
static uint8_t ticks;        /* of the internal time base, within one cycle */
static uint8_t quiet_ticks;  /* since the last crossing, saturating */
static uint8_t crossings;    /* accepted in a row, saturating */
static bool synchronous;     /* cycles begin at crossings, not at the internal time base */
static bool second_half;

static void pin_off(void) { PORTD &= (uint8_t)~_BV(HEATER_PIN); }
static void pin_on(void) { PORTD |= _BV(HEATER_PIN); }

static void gate_timer_stop(void)
{
    TCCR2B = 0;
    TIMSK2 = 0;
    TIFR2 = _BV(OCF2A);
}

/* Set the next stretch of `gate_left`; the timer clears itself at a match and runs on. */
static void gate_timer_stretch(void)
{
    uint16_t stretch = gate_left;
    if (stretch > STRETCH_MAX + STRETCH_MIN)
        stretch = STRETCH_MAX;
    else if (stretch > STRETCH_MAX)
        stretch = STRETCH_MAX / 2;
    OCR2A = (uint8_t)(stretch - 1);
    gate_left -= stretch;
}

static void gate_timer_start(uint16_t counts)
{
    gate_timer_stop();
    gate_left = counts;
    TCNT2 = 0;
    TCCR2A = _BV(WGM21);
    gate_timer_stretch();
    TIMSK2 = _BV(OCIE2A);
    TCCR2B = _BV(CS22); /* F_CPU / 64 */
}

static void off(void)
{
    pin_off();
    gate_timer_stop();
    power = 0;
    left_ms = 0;
    accumulator = 0;
    fire_delay = 0;
}

/* From a crossing to the gate, for a power: P/P0 = 1 - a/pi + sin(2a)/(2 pi), inverted. */
static uint16_t delay_for(uint16_t wanted)
{
    if (wanted == 0)
        return 0;
    uint32_t place = (uint32_t)wanted * PHASE_STEPS; /* in 1/10000 of a step */
    uint8_t step = (uint8_t)(place / FULL_POWER);
    if (step >= PHASE_STEPS)
        return GATE_MARGIN;
    uint16_t high = pgm_read_word(&phase_table[step]);
    uint16_t low = pgm_read_word(&phase_table[step + 1]);
    uint32_t within = place - (uint32_t)step * FULL_POWER;
    uint16_t angle = high - (uint16_t)((uint32_t)(high - low) * within / FULL_POWER);
    uint16_t delay = (uint16_t)(((uint32_t)angle * half_wave) >> 16);
    if (delay < GATE_MARGIN)
        return GATE_MARGIN;
    if (delay > half_wave - 2 * GATE_MARGIN)
        return half_wave - 2 * GATE_MARGIN;
    return delay;
}

void heater_configure(const struct configuration *chosen, enum cut_reason reason)
{
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        off();
        setup = *chosen;
        half_wave = (uint16_t)(GATE_HZ / 2 / chosen->mains_hz);
        cut = reason;
        crossings = 0;
        synchronous = false;
    }
}

uint16_t heater_set(uint16_t wanted, uint16_t *valid_ms)
{
    if (wanted > setup.power_max)
        wanted = setup.power_max;
    if (*valid_ms > setup.dead_man_ms)
        *valid_ms = setup.dead_man_ms;
    if (setup.mode == MODE_PHASE_ANGLE && wanted < PHASE_LEAST)
        wanted = 0;
    uint16_t delay = delay_for(wanted);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        if (wanted == 0)
            off(); /* at once, even within a cycle */
        power = wanted;
        fire_delay = delay;
        left_ms = *valid_ms;
        cut = CUT_NONE;
    }
    return wanted;
}

uint16_t heater_power(void)
{
    uint16_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = power; }
    return now;
}

enum cut_reason heater_cut(void) { return (enum cut_reason)cut; }

bool heater_zero_cross_seen(void) { return synchronous; }

/* The dead-man lives in the interrupt: it works even while the main loop is stuck. */
void heater_millisecond(void)
{
    if (left_ms != 0 && --left_ms == 0) {
        if (power != 0)
            cut = CUT_DEAD_MAN;
        off();
    }
}

/* Whole cycles only: both half waves or none, so that no direct current flows. */
static void begin_cycle(void)
{
    uint16_t sum = accumulator + power;
    if (power != 0 && sum >= FULL_POWER) {
        sum -= FULL_POWER;
        pin_on();
    } else {
        pin_off();
    }
    accumulator = sum;
}

void heater_tick(void)
{
    if (quiet_ticks < UINT8_MAX)
        quiet_ticks++;
    if (synchronous && quiet_ticks > MISSING_HALVES * TICKS_PER_HALF) {
        synchronous = false;
        crossings = 0;
        ticks = 0;
        pin_off();
    }
    if (++ticks < TICKS_PER_CYCLE)
        return;
    ticks = 0;
    if (synchronous)
        return;
    if (crossings >= TRUSTED_CROSSINGS) {
        /* Hand over between two cycles, the pin low until the next crossing. */
        synchronous = true;
        second_half = true;
        pin_off();
        return;
    }
    /* Without crossings an angle means nothing: a gate at a random phase fires the triac for
     * half the power on average, however little was asked. Whole cycles keep the mean right. */
    begin_cycle();
}

ISR(INT0_vect)
{
    if (quiet_ticks < TICKS_PER_HALF - TICKS_PER_HALF / 4)
        return; /* contact noise, not a crossing */
    bool in_time = quiet_ticks <= TICKS_PER_HALF + TICKS_PER_HALF / 4;
    quiet_ticks = 0;
    if (!in_time)
        crossings = 0;
    else if (crossings < UINT8_MAX)
        crossings++;
    if (!synchronous)
        return;
    second_half = !second_half;
    if (setup.mode == MODE_BURST) {
        if (!second_half)
            begin_cycle();
        return;
    }
    pin_off();
    gate_open = false;
    gate_delay = fire_delay;
    if (gate_delay != 0)
        gate_timer_start(gate_delay);
    else
        gate_timer_stop();
}

ISR(TIMER2_COMPA_vect)
{
    if (gate_left != 0) {
        gate_timer_stretch();
    } else if (!gate_open && power != 0) {
        gate_open = true;
        pin_on();
        gate_timer_start(half_wave - (uint16_t)GATE_MARGIN - gate_delay);
    } else {
        pin_off();
        gate_timer_stop();
    }
}
