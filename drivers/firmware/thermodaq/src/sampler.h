/* The converter: evenly spaced conversions, summed over whole mains periods. */
#ifndef THERMODAQ_SAMPLER_H
#define THERMODAQ_SAMPLER_H

#include <stdint.h>

struct sample {
    uint32_t sum;      /* of `count` conversions of 10 bits */
    uint16_t count;    /* 0: none finished yet */
    uint16_t sequence; /* counts finished samples, modulo 65536 */
    uint16_t age_ms;   /* since the middle of the burst */
};

void sampler_start(void);

/* Begin a new burst of `periods` mains periods; the sample before it is forgotten. */
void sampler_configure(uint8_t mains_hz, uint8_t periods);

struct sample sampler_read(void);

/* Milliseconds and conversions so far, modulo 256: what the watchdog is fed by. */
uint8_t sampler_milliseconds(void);
uint8_t sampler_conversions(void);

#endif
