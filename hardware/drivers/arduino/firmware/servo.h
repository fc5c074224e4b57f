// Four servos on pins 8 to 11 of an Uno or Nano (PB0 to PB3), 50 pulses a second each.

#pragma once

#include <stdbool.h>
#include <stdint.h>

#define SERVOS 4

// True from 1 ms before each cycle of 20 ms until somebody clears it: time for new widths.
extern volatile bool servo_due;

// Start the pulses; set the first widths before.
void servo_begin(void);

// Pulse widths [us], all in the same cycle.
void servo_pulses(const uint16_t us[SERVOS]);

// What the Arduino Servo library makes of an angle [1/256 deg]: 544 to 2400 us, cut to whole ones.
uint16_t servo_us(uint16_t angle);
