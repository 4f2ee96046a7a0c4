/* Firing angle by power: entry i of 64 is a/pi in 1/65536, where 1 - a/pi + sin(2a)/(2 pi) = i/64.
 * A test of the host side solves the equation again and compares. */
#ifndef THERMODAQ_PHASE_TABLE_H
#define THERMODAQ_PHASE_TABLE_H

#include <avr/pgmspace.h>
#include <stdint.h>

#define PHASE_STEPS 64U

static const uint16_t phase_table[PHASE_STEPS + 1] PROGMEM = {
    65535, 56687, 54305, 52598, 51212, 50022, 48963, 48001, 47112, 46282,
    45499, 44755, 44044, 43361, 42701, 42063, 41443, 40839, 40248, 39670,
    39103, 38545, 37996, 37454, 36918, 36388, 35863, 35341, 34823, 34307,
    33793, 33280, 32768, 32256, 31743, 31229, 30713, 30195, 29673, 29148,
    28618, 28082, 27540, 26991, 26433, 25866, 25288, 24697, 24093, 23473,
    22835, 22175, 21492, 20781, 20037, 19254, 18424, 17535, 16573, 15514,
    14324, 12938, 11231, 8849, 0,
};

#endif
