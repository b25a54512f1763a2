/* The serial port: 57600 baud, 8N1, both directions through buffers. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

void uart_begin(void);
/* The next byte that came; false where there is none. */
bool uart_receive(uint8_t *byte);
bool uart_pending(void);
/* Waits while the buffer is full; steps go on meanwhile. */
void uart_send(uint8_t byte);
