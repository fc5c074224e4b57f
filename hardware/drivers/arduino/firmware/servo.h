// Four servos on pins 8 to 11 of an Uno or Nano (PB0 to PB3), 50 pulses a second each.

#pragma once

#include <stdbool.h>
#include <stdint.h>

#define SERVOS 4

// Becomes true 1 ms before each cycle of 20 ms, as the time to set new widths. The caller clears it.
extern volatile bool servo_due;

// Start the pulses. Set the first widths before.
void servo_begin(void);

// Pulse widths [us], all in the same cycle.
void servo_pulses(const uint16_t us[SERVOS]);

// Pulse width for an angle [1/256 deg], as in the Arduino Servo library: 544 to 2400 us, truncated.
uint16_t servo_us(uint16_t angle);
