/* The stepper: half steps by timer 1, so that nothing else delays them. */
#pragma once
#include <stdbool.h>
#include <stdint.h>

/* Four different pins of D2 to D13, energised in the order 1, 3, 2, 4, a step being so many half steps. It
 * stands at 0 then, at a step a second, without ramps. */
void motor_configure(const uint8_t pins[4], uint8_t half_steps);
bool motor_is_configured(void);
/* Whether a pin of D0 to D13 leads to a coil. */
bool motor_uses(uint8_t pin);
/* No motor any more; its coils are off. */
void motor_forget(void);

int32_t motor_position(void);
void motor_to(int32_t position);
void motor_stop(void);
void motor_zero(void);
/* Coils off until the next step, or on. */
void motor_enable(bool on);
/* In steps per second, and per second squared; no acceleration is at once. */
void motor_speed(float speed);
void motor_acceleration(float acceleration);
/* Whether a move has ended since the last call. */
bool motor_has_arrived(void);
bool motor_arrival_pending(void);
