#include "motor.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <math.h>
#include <stdlib.h>
#include <util/atomic.h>

/* Timer 1 counts at an eighth of the clock. */
#define TICKS_PER_S (F_CPU / 8)
/* 5000 steps a second; a 28BYJ-48 makes 1000. */
#define SHORTEST (TICKS_PER_S / 5000)
/* A step in 17 minutes. */
#define LONGEST 2000000000UL
/* Longer intervals are counted in pieces. */
#define PIECE 30000U

static bool configured;
static uint8_t mask_b, mask_d;
/* The levels of both ports in each of the eight half steps. */
static uint8_t coils_b[8], coils_d[8];
static uint8_t half_steps_per_step;

static volatile int32_t position, target;
static volatile bool running, arrived;
static volatile uint8_t phase;
static volatile int8_t direction;
/* Ticks that are left of an interval beyond the timer's present one. */
static volatile uint32_t remaining;
/* Of the fastest step. */
static volatile uint32_t cruise = TICKS_PER_S;
/* Of the first step of a ramp; 0 where there is none. */
static volatile float first;
/* How many steps it takes to stop, and how many at full speed. */
static volatile int32_t ramp, ramp_most;
static float speed_now = 1, acceleration_now;

static void energise(void) {
    /* A port without coils is not ours. */
    if (mask_b)
        PORTB = (PORTB & ~mask_b) | coils_b[phase];
    if (mask_d)
        PORTD = (PORTD & ~mask_d) | coils_d[phase];
}

static void wait(uint32_t ticks) {
    uint16_t piece = ticks > PIECE ? PIECE : ticks;
    /* What is left for the last piece must not be too short to be set. */
    if (ticks > piece && ticks - piece < SHORTEST)
        piece -= SHORTEST;
    remaining = ticks - piece;
    OCR1A = piece - 1;
}

/* Plans the next step; false where there is none to take. */
static bool plan(void) {
    int32_t left = target - position;
    if (first == 0) {
        ramp = 0;
        if (left == 0)
            return false;
        direction = left > 0 ? 1 : -1;
        wait(cruise);
        return true;
    }
    bool away = ramp > 0 && (left == 0 || (left > 0) != (direction > 0));
    if (left == 0 && ramp <= 1)
        return false;
    if (away || (ramp > 0 && ramp >= labs(left)) || ramp > ramp_most)
        ramp--;
    else if (ramp < ramp_most)
        ramp++;
    if (ramp == 0)
        ramp = 1;
    if (ramp == 1 && left != 0)
        direction = left > 0 ? 1 : -1;
    float ticks = first / sqrtf(ramp);
    uint32_t interval = ticks < LONGEST ? (uint32_t)ticks : LONGEST;
    wait(interval < cruise ? cruise : interval);
    return true;
}

static void halt(void) {
    TIMSK1 = 0;
    TCCR1B = 0;
    running = false;
    ramp = 0;
}

ISR(TIMER1_COMPA_vect) {
    if (remaining > 0) {
        wait(remaining);
        return;
    }
    position += direction;
    phase = (phase + direction * half_steps_per_step) & 7;
    energise();
    if (!plan()) {
        halt();
        arrived = true;
    }
}

static void ramp_up(void) {
    float steps = acceleration_now > 0 ? speed_now * speed_now / (2 * acceleration_now) : 0;
    float start = acceleration_now > 0 ? TICKS_PER_S / sqrtf(2 * acceleration_now) : 0;
    float interval = speed_now > 0 ? TICKS_PER_S / speed_now : LONGEST;
    uint32_t fastest = interval < SHORTEST ? SHORTEST : interval < LONGEST ? (uint32_t)interval : LONGEST;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        cruise = fastest;
        first = start;
        ramp_most = steps < 1 ? 1 : steps < 1e9f ? (int32_t)steps : 1000000000L;
    }
}

void motor_speed(float speed) {
    speed_now = fabsf(speed);
    ramp_up();
}

void motor_acceleration(float acceleration) {
    acceleration_now = fabsf(acceleration);
    ramp_up();
}

void motor_forget(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        halt();
        arrived = false;
    }
    configured = false;
    motor_enable(false);
    mask_b = mask_d = 0;
}

void motor_configure(const uint8_t pins[4], uint8_t half_steps) {
    motor_forget();
    static const uint8_t order[4] = {0, 2, 1, 3};
    for (uint8_t i = 0; i < 8; i++)
        coils_b[i] = coils_d[i] = 0;
    for (uint8_t i = 0; i < 4; i++) {
        uint8_t pin = pins[order[i]];
        uint8_t b = pin < 8 ? 0 : _BV(pin - 8), d = pin < 8 ? _BV(pin) : 0;
        mask_b |= b;
        mask_d |= d;
        /* On in its own half step, and in those before and after. */
        for (uint8_t at = 7; at <= 9; at++) {
            coils_b[(2 * i + at) & 7] |= b;
            coils_d[(2 * i + at) & 7] |= d;
        }
    }
    half_steps_per_step = half_steps;
    motor_enable(false);
    DDRB |= mask_b;
    DDRD |= mask_d;
    /* Coils count with the position, as AccelStepper's do: a host may compare them. */
    position = target = 0;
    phase = 0;
    acceleration_now = 0;
    motor_speed(1);
    configured = true;
}

bool motor_is_configured(void) { return configured; }

bool motor_uses(uint8_t pin) {
    return pin < 8 ? mask_d >> pin & 1 : mask_b >> (pin - 8) & 1;
}

int32_t motor_position(void) {
    int32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = position; }
    return now;
}

void motor_to(int32_t to) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        target = to;
        arrived = false;
        if (!running) {
            TCNT1 = 0;
            ramp = 0;
            if (plan()) {
                running = true;
                TIFR1 = _BV(OCF1A);
                TIMSK1 = _BV(OCIE1A);
                TCCR1A = 0;
                TCCR1B = _BV(WGM12) | _BV(CS11);
            } else {
                arrived = true;
            }
        }
    }
}

void motor_stop(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        halt();
        target = position;
        arrived = true;
    }
}

void motor_zero(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        halt();
        position = target = 0;
        arrived = false;
    }
}

void motor_enable(bool on) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        if (on && configured) {
            energise();
        } else {
            PORTB &= ~mask_b;
            PORTD &= ~mask_d;
        }
    }
}

bool motor_arrival_pending(void) { return arrived; }

bool motor_has_arrived(void) {
    bool was;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        was = arrived;
        arrived = false;
    }
    return was;
}
