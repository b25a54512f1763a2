/* The part of Firmata 2.6 that a host of a stepper meets. */
#pragma once
#include <stdint.h>

/* Sends the version and the firmware, as after a reset. */
void firmata_begin(void);
void firmata_receive(uint8_t byte);
/* Reports events: a move that ended, a switch that changed. */
void firmata_report(void);
