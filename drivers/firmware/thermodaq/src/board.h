/* Wiring and constants of the thermodaq board: an ATmega328P at 16 MHz (Arduino Uno).
 *
 *   PC0 / A0  analog input, LM335
 *   PD2 / D2  zero-cross input, rising edge at each zero crossing, pulled up; may stay open
 *   PD3 / D3  heater output, high = on
 *   PD0, PD1  serial line, 115200 8N1
 */
#ifndef THERMODAQ_BOARD_H
#define THERMODAQ_BOARD_H

#include <stdint.h>

#define PRODUCT "thermodaq"
#define PROTOCOL 1
#define FIRMWARE_VERSION "1.0.0"

#define ZERO_CROSS_PIN PD2
#define HEATER_PIN PD3

#define FULL_POWER 10000U /* a power of 1 in the protocol's unit, 1/10000 */

/* Timer 0: 1 kHz. Timer 1: one conversion and one step of the internal time base every 1/32 of a
 * mains period. Timer 2: the gate of the phase angle. */
#define TIMER1_HZ (F_CPU / 8UL)
#define GATE_HZ (F_CPU / 64UL)
#define TICKS_PER_CYCLE 32U
#define TICKS_PER_HALF (TICKS_PER_CYCLE / 2U)

#define DEAD_MAN_DEFAULT_MS 2500U

enum output_mode { MODE_BURST = 0, MODE_PHASE_ANGLE = 1 };

/* Why the output is off although nobody commanded it. */
enum cut_reason { CUT_NONE = 0, CUT_DEAD_MAN = 1, CUT_RESET = 2, CUT_CONFIGURED = 3 };

/* What the host chooses; until it does, the board measures but takes no power. */
struct configuration {
    uint8_t mode;          /* enum output_mode */
    uint8_t mains_hz;      /* 50 or 60 */
    uint8_t periods;       /* mains periods averaged into one sample, 1..50 */
    uint16_t dead_man_ms;  /* longest validity of an output command */
    uint16_t power_max;    /* cap of the output, 0..FULL_POWER */
};

#endif
