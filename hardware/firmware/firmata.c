#include "firmata.h"

#include <avr/io.h>
#include <stdbool.h>
#include <util/atomic.h>

#include "motor.h"
#include "uart.h"

#define NAME "foxhunt-stepper"
#define NAME_MAJOR 1
#define NAME_MINOR 1

#define SYSEX 0xF0
#define END_SYSEX 0xF7
#define VERSION 0xF9
#define RESET 0xFF
#define PIN_MODE 0xF4
#define REPORT_DIGITAL 0xD0
#define DIGITAL 0x90
#define STEPPER 0x62
#define ANALOG_MAPPING_QUERY 0x69
#define ANALOG_MAPPING 0x6A
#define CAPABILITY_QUERY 0x6B
#define CAPABILITIES 0x6C
#define TEXT 0x71
#define FIRMWARE 0x79

#define MODE_INPUT 0x00
#define MODE_STEPPER 0x08
#define MODE_PULLUP 0x0B

#define PINS 20
/* D0 and D1 are the serial port, A0 to A5 are left alone. */
#define FIRST_PIN 2
#define LAST_PIN 13
#define LONGEST 32

static uint8_t data[LONGEST], length, status, wanted;
static bool in_sysex;
static uint8_t device;
static uint8_t inputs[2];
static bool reported[2];
static uint8_t last[2];

static void send_text(const char *text) {
    for (; *text; text++) {
        uart_send(*text & 0x7F);
        uart_send((uint8_t)*text >> 7);
    }
}

static void send_version(void) {
    uart_send(VERSION);
    uart_send(2);
    uart_send(6);
}

static void send_firmware(void) {
    uart_send(SYSEX);
    uart_send(FIRMWARE);
    uart_send(NAME_MAJOR);
    uart_send(NAME_MINOR);
    send_text(NAME);
    uart_send(END_SYSEX);
}

static void complain(const char *text) {
    uart_send(SYSEX);
    uart_send(TEXT);
    send_text(text);
    uart_send(END_SYSEX);
}

static void send_capabilities(void) {
    uart_send(SYSEX);
    uart_send(CAPABILITIES);
    for (uint8_t pin = 0; pin < PINS; pin++) {
        if (pin >= FIRST_PIN && pin <= LAST_PIN) {
            static const uint8_t can[] = {MODE_INPUT, 1, MODE_PULLUP, 1, MODE_STEPPER, 21};
            for (uint8_t i = 0; i < sizeof can; i++)
                uart_send(can[i]);
        }
        uart_send(0x7F);
    }
    uart_send(END_SYSEX);
}

static void send_analog_mapping(void) {
    uart_send(SYSEX);
    uart_send(ANALOG_MAPPING);
    for (uint8_t pin = 0; pin < PINS; pin++)
        uart_send(0x7F);
    uart_send(END_SYSEX);
}

/* Where the motor is: 06 as an answer, 0A at the end of a move. */
static void send_position(uint8_t kind) {
    int32_t position = motor_position();
    uint32_t magnitude = position < 0 ? -(uint32_t)position : (uint32_t)position;
    uart_send(SYSEX);
    uart_send(STEPPER);
    uart_send(kind);
    uart_send(device);
    for (uint8_t i = 0; i < 4; i++, magnitude >>= 7)
        uart_send(magnitude & 0x7F);
    uart_send((magnitude & 0x07) | (position < 0 ? 0x08 : 0));
    uart_send(END_SYSEX);
}

static int32_t whole(const uint8_t *bytes) {
    uint32_t magnitude = bytes[4] & 0x07;
    for (int8_t i = 3; i >= 0; i--)
        magnitude = magnitude << 7 | bytes[i];
    return bytes[4] & 0x08 ? -(int32_t)magnitude : (int32_t)magnitude;
}

static float decimal(const uint8_t *bytes) {
    uint32_t significand = (uint32_t)(bytes[3] & 0x03) << 21 | (uint32_t)bytes[2] << 14 |
                           (uint16_t)bytes[1] << 7 | bytes[0];
    int8_t exponent = (int8_t)(bytes[3] >> 2 & 0x0F) - 11;
    float value = significand;
    for (; exponent > 0; exponent--)
        value *= 10;
    for (; exponent < 0; exponent++)
        value /= 10;
    return bytes[3] & 0x40 ? -value : value;
}

static void configure(const uint8_t *bytes, uint8_t count) {
    uint8_t step = count ? bytes[0] >> 1 & 7 : 0;
    if (count < 5 || bytes[0] >> 4 != 4 || step > 1) {
        complain("a stepper here has four wires, and whole or half steps");
        return;
    }
    for (uint8_t i = 1; i <= 4; i++) {
        bool doubled = false;
        for (uint8_t j = 1; j < i; j++)
            doubled |= bytes[j] == bytes[i];
        if (doubled || bytes[i] < FIRST_PIN || bytes[i] > LAST_PIN) {
            complain("a stepper here has four pins of D2 to D13");
            return;
        }
    }
    for (uint8_t i = 1; i <= 4; i++)
        inputs[bytes[i] >> 3] &= ~_BV(bytes[i] & 7);
    motor_configure(bytes + 1, step ? 1 : 2);
}

static void stepper(const uint8_t *bytes, uint8_t count) {
    if (count < 2)
        return;
    uint8_t command = bytes[0], of = bytes[1];
    bytes += 2;
    count -= 2;
    if (command == 0x00) {
        device = of;
        configure(bytes, count);
        return;
    }
    if (!motor_is_configured() || of != device)
        return;
    switch (command) {
    case 0x01:
        /* One with a position is an order to go there that was garbled. */
        if (count == 0)
            motor_zero();
        break;
    case 0x02:
        if (count == 5)
            motor_to(motor_position() + whole(bytes));
        break;
    case 0x03:
        if (count == 5)
            motor_to(whole(bytes));
        break;
    case 0x04:
        if (count == 1)
            motor_enable(bytes[0]);
        break;
    case 0x05:
        motor_stop();
        break;
    case 0x06:
        send_position(0x06);
        break;
    case 0x08:
        if (count == 4)
            motor_acceleration(decimal(bytes));
        break;
    case 0x09:
        if (count == 4)
            motor_speed(decimal(bytes));
        break;
    }
}

static void sysex(void) {
    switch (data[0]) {
    case FIRMWARE:
        if (length == 1)
            send_firmware();
        break;
    case CAPABILITY_QUERY:
        send_capabilities();
        break;
    case ANALOG_MAPPING_QUERY:
        send_analog_mapping();
        break;
    case STEPPER:
        stepper(data + 1, length - 1);
        break;
    }
}

static void pin_mode(uint8_t pin, uint8_t mode) {
    if (pin < FIRST_PIN || pin > LAST_PIN || (mode != MODE_INPUT && mode != MODE_PULLUP))
        return;
    uint8_t bit = _BV(pin & 7);
    if (motor_uses(pin)) {
        /* It goes on driving its coil, and has its level reported. */
        inputs[pin >> 3] |= bit;
        return;
    }
    /* A step between reading a port and writing it would be undone. */
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        if (pin < 8) {
            DDRD &= ~bit;
            PORTD = mode == MODE_PULLUP ? PORTD | bit : PORTD & ~bit;
        } else {
            DDRB &= ~bit;
            PORTB = mode == MODE_PULLUP ? PORTB | bit : PORTB & ~bit;
        }
    }
    inputs[pin >> 3] |= bit;
}

static uint8_t levels_of(uint8_t port) { return (port ? PINB : PIND) & inputs[port]; }

static void send_levels(uint8_t port) {
    uint8_t levels = levels_of(port);
    uart_send(DIGITAL | port);
    uart_send(levels & 0x7F);
    uart_send(levels >> 7);
    last[port] = levels;
}

static void short_message(void) {
    if (status == PIN_MODE) {
        pin_mode(data[0], data[1]);
    } else {
        uint8_t port = status & 0x0F;
        if (port < 2) {
            reported[port] = data[0];
            if (reported[port])
                send_levels(port);
        }
    }
}

static void begin_message(uint8_t byte) {
    /* What was cut is forgotten. */
    length = wanted = 0;
    in_sysex = byte == SYSEX;
    status = byte;
    if (byte == VERSION) {
        send_version();
    } else if (byte == RESET) {
        motor_forget();
        reported[0] = reported[1] = false;
        inputs[0] = inputs[1] = 0;
    } else if (byte == PIN_MODE) {
        wanted = 2;
    } else if ((byte & 0xF0) == REPORT_DIGITAL) {
        wanted = 1;
    }
}

void firmata_begin(void) {
    send_version();
    send_firmware();
}

void firmata_receive(uint8_t byte) {
    if (byte == END_SYSEX && in_sysex) {
        in_sysex = false;
        /* One that was too long was not for a stepper. */
        if (length > 0 && length < LONGEST)
            sysex();
        return;
    }
    if (byte >= 0x80) {
        begin_message(byte);
        return;
    }
    if (!in_sysex && wanted == 0)
        return;
    if (length < LONGEST)
        data[length++] = byte;
    if (!in_sysex && length == wanted) {
        wanted = 0;
        short_message();
    }
}

void firmata_report(void) {
    if (motor_has_arrived())
        send_position(0x0A);
    for (uint8_t port = 0; port < 2; port++)
        if (reported[port] && levels_of(port) != last[port])
            send_levels(port);
}
