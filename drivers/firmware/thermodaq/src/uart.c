#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define BAUD 115200UL
/* Double speed: 2.1 % fast at 16 MHz, where normal speed would be 3.5 % slow. */
#define DIVISOR ((F_CPU + 4UL * BAUD) / (8UL * BAUD) - 1)

/* One writer and one reader each, byte-wide indices: no lock is needed. Powers of two. */
#define RX_SIZE 64U
#define TX_SIZE 128U

static volatile uint8_t rx_ring[RX_SIZE];
static volatile uint8_t rx_head, rx_tail;
static volatile uint8_t tx_ring[TX_SIZE];
static volatile uint8_t tx_head, tx_tail;

void uart_start(void)
{
    UCSR0A = _BV(U2X0); /* before the divisor, for simulators that work out the speed there */
    UBRR0 = DIVISOR;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

int16_t uart_read(void)
{
    uint8_t tail = rx_tail;
    if (tail == rx_head)
        return -1;
    uint8_t byte = rx_ring[tail];
    rx_tail = (uint8_t)(tail + 1U) & (RX_SIZE - 1U);
    return byte;
}

bool uart_write(const char *bytes, uint8_t length)
{
    uint8_t head = tx_head;
    uint8_t free = (uint8_t)(tx_tail - head - 1U) & (TX_SIZE - 1U);
    if (length > free)
        return false;
    while (length--) {
        tx_ring[head] = (uint8_t)*bytes++;
        head = (uint8_t)(head + 1U) & (TX_SIZE - 1U);
    }
    tx_head = head;
    UCSR0B |= _BV(UDRIE0);
    return true;
}

ISR(USART_RX_vect)
{
    uint8_t byte = UDR0;
    uint8_t next = (uint8_t)(rx_head + 1U) & (RX_SIZE - 1U);
    if (next == rx_tail)
        return; /* lost: the checksum of the line will tell */
    rx_ring[rx_head] = byte;
    rx_head = next;
}

ISR(USART_UDRE_vect)
{
    uint8_t tail = tx_tail;
    if (tail == tx_head) {
        UCSR0B &= (uint8_t)~_BV(UDRIE0);
        return;
    }
    UDR0 = tx_ring[tail];
    tx_tail = (uint8_t)(tail + 1U) & (TX_SIZE - 1U);
}
