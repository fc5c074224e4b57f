#include "servo.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

// Timer 1 runs free at 2 MHz, so a tick is 0.5 us and every time wraps with 16 bits.
#define TICKS_PER_US 2
#define CYCLE (20000u * TICKS_PER_US)
#define NOTICE (1000u * TICKS_PER_US)
// The interrupt starts this much before an edge and waits for it. Other interrupts take less time
// than this, so they cannot delay the edge.
#define LEAD (12u * TICKS_PER_US)
#define PINS 0x0f

volatile bool servo_due;
static volatile uint16_t widths[SERVOS];  // [ticks]

void servo_begin(void) {
    PORTB &= ~PINS;
    DDRB |= PINS;
    TCCR1A = 0;
    TCCR1B = _BV(CS11);  // 16 MHz / 8
    OCR1A = TCNT1 + NOTICE;
    TIMSK1 = _BV(OCIE1A);
}

void servo_pulses(const uint16_t us[SERVOS]) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        for (uint8_t i = 0; i < SERVOS; i++) widths[i] = us[i] * TICKS_PER_US;
    }
}

uint16_t servo_us(uint16_t angle) {
    return 544 + (uint32_t)angle * (2400 - 544) / (180ul * 256);
}

// The edges of a cycle: pins 0 to 3 rise in turn, each when the one before falls; then all are low;
// then comes the notice for the next cycle.
ISR(TIMER1_COMPA_vect) {
    static uint8_t next;
    static uint16_t start;
    static uint16_t ticks[SERVOS];
    uint16_t edge = OCR1A + LEAD;
    uint8_t port = PORTB & ~PINS;
    if (next < SERVOS) port |= 1 << next;
    while ((int16_t)(TCNT1 - edge) < 0) {
    }
    PORTB = port;
    if (next == 0) {
        start = edge;
        for (uint8_t i = 0; i < SERVOS; i++) ticks[i] = widths[i];
    }
    if (next < SERVOS) {
        edge += ticks[next++];
    } else if (next == SERVOS) {
        edge = start + CYCLE - NOTICE;
        next++;
    } else {
        edge = start + CYCLE;
        next = 0;
        servo_due = true;
    }
    OCR1A = edge - LEAD;
}
