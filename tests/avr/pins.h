// The pulses on the pins of the four servos.

#pragma once

#include "sim_avr.h"

#define HZ 16000000.0

extern avr_t *avr;

// Look at the pins from now on.
void pins_watch(void);

// A reset has taken the pins down.
void pins_idle(void);

// Print a JSON object for each servo, with commas between; what was seen is then forgotten.
void pins_report(void);
