/* The heater output: whole-cycle burst or phase angle, and the dead-man that cuts it. */
#ifndef THERMODAQ_HEATER_H
#define THERMODAQ_HEATER_H

#include <stdbool.h>
#include <stdint.h>

#include "board.h"

/* Output off and the chosen mode in force; the reason is reported until the next command. */
void heater_configure(const struct configuration *chosen, enum cut_reason reason);

/* Take `power` (limited to the cap) for `valid_ms` (limited to the dead-man); return the power. */
uint16_t heater_set(uint16_t power, uint16_t *valid_ms);

uint16_t heater_power(void);
enum cut_reason heater_cut(void);
bool heater_zero_cross_seen(void);

/* One step of the internal time base; called from the timer's interrupt. */
void heater_tick(void);

/* One millisecond has passed; called from the timer's interrupt. */
void heater_millisecond(void);

#endif
