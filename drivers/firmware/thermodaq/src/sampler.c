#include "sampler.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

#include "board.h"
#include "heater.h"

static volatile uint16_t now_ms;
static volatile uint8_t conversions;

static uint16_t wanted; /* conversions in a burst */
static uint16_t taken;
static uint16_t began_ms;
static uint32_t running_sum;

static volatile uint32_t last_sum;
static volatile uint16_t last_count;
static volatile uint16_t last_middle_ms;
static volatile uint16_t sequence;

void sampler_configure(uint8_t mains_hz, uint8_t periods)
{
    uint16_t rate = (uint16_t)(mains_hz * TICKS_PER_CYCLE);
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        OCR1A = (uint16_t)((TIMER1_HZ + rate / 2) / rate - 1); /* 60 Hz: 0.03 % long */
        TCNT1 = 0;
        wanted = (uint16_t)periods * TICKS_PER_CYCLE;
        taken = 0;
        running_sum = 0;
        last_count = 0;
    }
}

void sampler_start(void)
{
    /* Reference AVCC, input ADC0, digital buffer of that pin off; 125 kHz, 104 us a conversion. */
    ADMUX = _BV(REFS0);
    DIDR0 = _BV(ADC0D);
    ADCSRA = _BV(ADEN) | _BV(ADIE) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);

    /* Timer 0: 1 kHz. */
    TCCR0A = _BV(WGM01);
    OCR0A = F_CPU / 64 / 1000 - 1;
    TIMSK0 = _BV(OCIE0A);
    TCCR0B = _BV(CS01) | _BV(CS00);

    /* Timer 1: F_CPU / 8, cleared at each match. */
    TIMSK1 = _BV(OCIE1A);
    TCCR1A = 0;
    TCCR1B = _BV(WGM12) | _BV(CS11);
}

struct sample sampler_read(void)
{
    struct sample read;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE)
    {
        read.sum = last_count ? last_sum : 0;
        read.count = last_count;
        read.sequence = sequence;
        read.age_ms = last_count ? now_ms - last_middle_ms : 0;
    }
    return read;
}

uint8_t sampler_milliseconds(void) { return (uint8_t)now_ms; }
uint8_t sampler_conversions(void) { return conversions; }

ISR(TIMER0_COMPA_vect)
{
    now_ms++;
    heater_millisecond();
}

ISR(TIMER1_COMPA_vect)
{
    ADCSRA |= _BV(ADSC);
    heater_tick();
}

ISR(ADC_vect)
{
    uint16_t counts = ADC;
    conversions++;
    if (taken == 0) {
        began_ms = now_ms;
        running_sum = 0;
    }
    running_sum += counts;
    if (++taken < wanted)
        return;
    taken = 0;
    last_sum = running_sum;
    last_count = wanted;
    last_middle_ms = began_ms + (uint16_t)(now_ms - began_ms) / 2;
    sequence++;
}
