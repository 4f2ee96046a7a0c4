#include "protocol.h"

#include <avr/eeprom.h>
#include <stdbool.h>

#include "board.h"
#include "heater.h"
#include "line.h"
#include "sampler.h"
#include "uart.h"

#define LINE_MAX 48U
#define BYTES_PER_TURN 16U /* so that a flood leaves the main loop its turn */

#define FLAG_RESET 0x01        /* the board started since the last hello */
#define FLAG_UNCONFIGURED 0x02 /* no configuration since then: power is refused */
#define FLAG_CUT 0x04          /* the dead-man has cut the output */
#define FLAG_SYNCHRONOUS 0x08  /* the output follows the zero-cross input */
#define FLAG_HEATING 0x10      /* a power above zero is in force */

static uint16_t EEMEM stored_unit;

static char line[LINE_MAX];
static uint8_t line_length;
static bool collecting; /* a '>' came and the line is not too long yet */

static bool reset_seen = true;
static bool configured;
static uint8_t cause;

void protocol_start(uint8_t reset_cause)
{
    static const struct configuration defaults = {
        .mode = MODE_BURST,
        .mains_hz = 50,
        .periods = 2,
        .dead_man_ms = DEAD_MAN_DEFAULT_MS,
        .power_max = 0,
    };
    cause = reset_cause;
    heater_configure(&defaults, CUT_RESET);
    sampler_configure(defaults.mains_hz, defaults.periods);
}

static uint8_t flags(void)
{
    uint8_t set = 0;
    if (reset_seen)
        set |= FLAG_RESET;
    if (!configured)
        set |= FLAG_UNCONFIGURED;
    if (heater_cut() == CUT_DEAD_MAN)
        set |= FLAG_CUT;
    if (heater_zero_cross_seen())
        set |= FLAG_SYNCHRONOUS;
    if (heater_power() != 0)
        set |= FLAG_HEATING;
    return set;
}

static uint16_t unit(void)
{
    uint16_t stored = eeprom_read_word(&stored_unit);
    return stored == UINT16_MAX ? 0 : stored; /* erased memory reads all ones */
}

static void refuse(const char *sequence, enum refusal why)
{
    reply_begin(sequence, 'E');
    reply_number(why);
    reply_send();
}

/* H: who is there. Acknowledges the reset flag, which the reply still shows. */
static enum refusal hello(const struct request *asked)
{
    reply_begin(asked->sequence, 'H');
    reply_word(PRODUCT);
    reply_number(PROTOCOL);
    reply_word(FIRMWARE_VERSION);
    reply_number(unit());
    reply_number(cause);
    reply_hex(flags());
    reset_seen = false;
    return ACCEPTED;
}

/* C mode mains_hz periods dead_man_ms power_max: output off, then the new configuration. */
static enum refusal configure(const struct request *asked)
{
    const uint16_t *given = asked->arguments;
    if (given[0] > MODE_PHASE_ANGLE || (given[1] != 50 && given[1] != 60))
        return REFUSED_RANGE;
    if (given[2] < 1 || given[2] > 50 || given[3] < 200 || given[3] > 10000)
        return REFUSED_RANGE;
    if (given[4] > FULL_POWER)
        return REFUSED_RANGE;
    const struct configuration chosen = {
        .mode = (uint8_t)given[0],
        .mains_hz = (uint8_t)given[1],
        .periods = (uint8_t)given[2],
        .dead_man_ms = given[3],
        .power_max = given[4],
    };
    heater_configure(&chosen, CUT_CONFIGURED);
    sampler_configure(chosen.mains_hz, chosen.periods);
    configured = true;
    reply_begin(asked->sequence, 'C');
    for (uint8_t i = 0; i < 5; i++)
        reply_number(given[i]);
    return ACCEPTED;
}

/* R: the last sample and the state of the output. */
static enum refusal read(const struct request *asked)
{
    struct sample last = sampler_read();
    reply_begin(asked->sequence, 'R');
    reply_number(last.sum);
    reply_number(last.count);
    reply_number(last.sequence);
    reply_number(last.age_ms);
    reply_number(heater_power());
    reply_number(heater_cut());
    reply_hex(flags());
    return ACCEPTED;
}

/* W power valid_ms: the only command that gives power, and the only one that re-arms the
 * dead-man. Power 0 is taken at any time. */
static enum refusal write(const struct request *asked)
{
    uint16_t power = asked->arguments[0], valid_ms = asked->arguments[1];
    if (power > FULL_POWER || valid_ms == 0)
        return REFUSED_RANGE;
    if (power != 0 && !configured)
        return REFUSED_UNCONFIGURED;
    uint16_t taken = heater_set(power, &valid_ms);
    reply_begin(asked->sequence, 'W');
    reply_number(taken);
    reply_number(valid_ms);
    reply_hex(flags());
    return ACCEPTED;
}

/* U number: keep a number that tells this board from another one. */
static enum refusal set_unit(const struct request *asked)
{
    if (heater_power() != 0)
        return REFUSED_HEATING; /* writing the memory takes milliseconds */
    if (asked->arguments[0] == UINT16_MAX)
        return REFUSED_RANGE;
    eeprom_update_word(&stored_unit, asked->arguments[0]);
    reply_begin(asked->sequence, 'U');
    reply_number(unit());
    return ACCEPTED;
}

static enum refusal obey(const struct request *asked)
{
    switch (asked->command) {
    case 'H':
        return asked->count == 0 ? hello(asked) : REFUSED_ARGUMENTS;
    case 'C':
        return asked->count == 5 ? configure(asked) : REFUSED_ARGUMENTS;
    case 'R':
        return asked->count == 0 ? read(asked) : REFUSED_ARGUMENTS;
    case 'W':
        return asked->count == 2 ? write(asked) : REFUSED_ARGUMENTS;
    case 'U':
        return asked->count == 1 ? set_unit(asked) : REFUSED_ARGUMENTS;
    default:
        return REFUSED_COMMAND;
    }
}

static void finish_line(void)
{
    static const char nobody[2] = {'-', '-'};
    struct request asked;
    enum refusal why = line_parse(line, line_length, &asked);
    bool known = why == ACCEPTED || why == REFUSED_ARGUMENTS;
    if (why == ACCEPTED)
        why = obey(&asked);
    if (why == ACCEPTED)
        reply_send();
    else
        refuse(known ? asked.sequence : nobody, why);
}

static void take(char c)
{
    if (c == '>') { /* always the start of a line, whatever came before it */
        collecting = true;
        line_length = 0;
    } else if (!collecting || c == '\r') {
        return;
    } else if (c == '\n') {
        collecting = false;
        finish_line();
    } else if (line_length < LINE_MAX) {
        line[line_length++] = c;
    } else {
        collecting = false; /* bounded: the rest is skipped up to the next '>' */
        refuse("--", REFUSED_TOO_LONG);
    }
}

void protocol_poll(void)
{
    for (uint8_t turn = 0; turn < BYTES_PER_TURN; turn++) {
        int16_t byte = uart_read();
        if (byte < 0)
            return;
        take((char)byte);
    }
}
