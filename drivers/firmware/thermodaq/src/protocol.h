/* The commands: what each one does, and when it is refused. */
#ifndef THERMODAQ_PROTOCOL_H
#define THERMODAQ_PROTOCOL_H

#include <stdint.h>

/* Everything off, the defaults in force; `reset_cause` is what the chip said at its start. */
void protocol_start(uint8_t reset_cause);

/* Take a few received bytes; called from the main loop, never waits. */
void protocol_poll(void);

#endif
