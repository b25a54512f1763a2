#include "uart.h"

#include <avr/interrupt.h>
#include <avr/io.h>

#define BAUD 57600
#include <util/setbaud.h>

/* Powers of two. */
#define IN_SIZE 128
#define OUT_SIZE 64

static volatile uint8_t in[IN_SIZE], in_head, in_tail;
static volatile uint8_t out[OUT_SIZE], out_head, out_tail;

void uart_begin(void) {
    UBRR0 = UBRR_VALUE;
#if USE_2X
    UCSR0A = _BV(U2X0);
#endif
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
}

ISR(USART_RX_vect) {
    uint8_t byte = UDR0, next = (in_head + 1) % IN_SIZE;
    /* A byte without room is lost, and so is its message. */
    if (next != in_tail) {
        in[in_head] = byte;
        in_head = next;
    }
}

ISR(USART_UDRE_vect) {
    if (out_head == out_tail) {
        UCSR0B &= ~_BV(UDRIE0);
    } else {
        UDR0 = out[out_tail];
        out_tail = (out_tail + 1) % OUT_SIZE;
    }
}

bool uart_pending(void) { return in_head != in_tail; }

bool uart_receive(uint8_t *byte) {
    if (!uart_pending())
        return false;
    *byte = in[in_tail];
    in_tail = (in_tail + 1) % IN_SIZE;
    return true;
}

void uart_send(uint8_t byte) {
    uint8_t next = (out_head + 1) % OUT_SIZE;
    while (next == out_tail)
        ;
    out[out_head] = byte;
    out_head = next;
    UCSR0B |= _BV(UDRIE0);
}
