// Four servos on pins 8 to 11 of an Uno or Nano (PB0 to PB3), 50 pulses a second each.

#pragma once

#include <stdbool.h>
#include <stdint.h>

#define SERVOS 4

// Becomes true 1 ms before each cycle of 20 ms: new widths may be set. The caller sets it to false.
extern volatile bool servo_due;

// Start the pulses. Call servo_pulses() first.
void servo_begin(void);

// Set the pulse widths [us]. All change in the same cycle.
void servo_pulses(const uint16_t us[SERVOS]);

// Return the pulse width [us] for an angle [1/256 deg], truncated: 544 to 2400 us, as in the Arduino
// Servo library.
uint16_t servo_us(uint16_t angle);
