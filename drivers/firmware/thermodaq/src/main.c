/* thermodaq: one temperature in, one heater out, and a heater that goes off by itself. */

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "board.h"
#include "protocol.h"
#include "sampler.h"
#include "uart.h"

/* Tells simavr what it runs; the section is not part of what is flashed. */
#if defined(__has_include)
#if __has_include(<avr/avr_mcu_section.h>)
#include <avr/avr_mcu_section.h>
AVR_MCU(F_CPU, "atmega328p");
AVR_MCU_VOLTAGES(5000, 5000, 5000);
#endif
#endif

static uint8_t reset_cause __attribute__((section(".noinit")));

/* Before anything else, memory included: heater pin low, then the watchdog, which after its own
 * reset runs on with its shortest time. */
__attribute__((naked, used, section(".init3"))) static void pin_first(void)
{
    PORTD &= (uint8_t)~_BV(HEATER_PIN);
    DDRD |= _BV(HEATER_PIN);
    reset_cause = MCUSR & 0x0F;
    MCUSR = 0;
    wdt_disable();
}

int main(void)
{
    PORTD |= _BV(ZERO_CROSS_PIN);        /* pull-up: an open input stays quiet */
    EICRA = _BV(ISC01) | _BV(ISC00);     /* rising edge */
    protocol_start(reset_cause);
    sampler_start();
    uart_start();
    EIFR = _BV(INTF0);
    EIMSK = _BV(INT0);
    wdt_enable(WDTO_250MS);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();

    /* The watchdog is fed by progress only: this loop, the clock of the dead-man and the
     * converter must all be alive. */
    uint8_t fed_ms = 0, fed_conversions = 0;
    for (;;) {
        protocol_poll();
        uint8_t ms = sampler_milliseconds(), conversions = sampler_conversions();
        if (ms != fed_ms && conversions != fed_conversions) {
            fed_ms = ms;
            fed_conversions = conversions;
            wdt_reset();
        }
        sleep_mode(); /* any interrupt wakes; the clock's does so within a millisecond */
    }
}
