/* An antenna's stepper behind Firmata: the messages of ConfigurableFirmata's AccelStepper for one motor
 * with four wires, and switches at digital inputs. 57600 baud. */
#include <avr/interrupt.h>
#include <avr/sleep.h>

#include "firmata.h"
#include "motor.h"
#include "uart.h"

int main(void) {
    /* Wakes it every 4 ms, to look at the switches. */
    TCCR0A = 1 << 1;
    TCCR0B = 1 << 2;
    OCR0A = 249;
    TIMSK0 = 1 << 1;
    uart_begin();
    sei();
    firmata_begin();
    set_sleep_mode(SLEEP_MODE_IDLE);
    for (;;) {
        uint8_t byte;
        while (uart_receive(&byte))
            firmata_receive(byte);
        firmata_report();
        cli();
        if (!uart_pending() && !motor_arrival_pending()) {
            sleep_enable();
            sei();
            sleep_cpu();
            sleep_disable();
        }
        sei();
    }
}

EMPTY_INTERRUPT(TIMER0_COMPA_vect)
