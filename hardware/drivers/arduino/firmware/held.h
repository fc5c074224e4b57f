// The angles of the servos, in memory that a reset does not change.

#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "servo.h"

// Get the angles [deg] from before the reset. Return false if there are none, as after power-on.
bool held_recall(uint8_t angles[SERVOS]);

// Store angles [deg].
void held_store(const uint8_t angles[SERVOS]);
