/* The serial line, interrupt driven in both directions; nothing here ever waits. */
#ifndef THERMODAQ_UART_H
#define THERMODAQ_UART_H

#include <stdbool.h>
#include <stdint.h>

void uart_start(void);

/* The next received byte, or -1. */
int16_t uart_read(void);

/* Queue all of `length` bytes, or none where there is no room; say which. */
bool uart_write(const char *bytes, uint8_t length);

#endif
