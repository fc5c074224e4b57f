// What the published sketch does, in our own words, for the same board and pins.
//
// It reads one byte at a time, turns one servo after the other a degree every 5 ms, and reads
// nothing meanwhile; its ring holds 63 bytes and drops what comes after. A letter selects the
// servo and the first digit, any other byte is taken for a digit, and a comma moves the servo.
// Where the sketch would write past its digits, this only counts.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdlib.h>
#include <string.h>
#include <util/atomic.h>

#include "servo.h"

#define SLOTS 64
// With what is around them, what the sketch takes with Arduino's core and Servo library: 5.058 ms a
// degree (delay(5) and Servo.write) and 0.12 ms a turn (atoi, and Servo.read twice).
#define STEP_TICKS 10015u
#define TURN_TICKS 125u
#define PULSE_MIN 544
#define PULSE_MAX 2400
#define DIGITS 4

// The simulator's host reads these from memory: bytes lost, bytes that would have overwritten.
volatile uint16_t counters[2];

static volatile uint8_t ring[SLOTS], ring_end, ring_start;
static uint16_t pulses[SERVOS];

ISR(USART_RX_vect) {
    uint8_t byte = UDR0, next = (ring_end + 1) % SLOTS;
    if (next == ring_start) {
        counters[0]++;
    } else {
        ring[ring_end] = byte;
        ring_end = next;
    }
}

static bool receive(uint8_t *byte) {
    if (ring_start == ring_end) return false;
    *byte = ring[ring_start];
    ring_start = (ring_start + 1) % SLOTS;
    return true;
}

// As the Arduino Servo library: below 544 an angle, from there on microseconds.
static void write(uint8_t servo, int value) {
    if (value < PULSE_MIN) {
        if (value < 0) value = 0;
        if (value > 180) value = 180;
        value = servo_us(value * 256u);
    }
    pulses[servo] = value > PULSE_MAX ? PULSE_MAX : value;
    servo_pulses(pulses);
}

static int read(uint8_t servo) {
    return (int32_t)(pulses[servo] + 1 - PULSE_MIN) * 180 / (PULSE_MAX - PULSE_MIN);
}

static uint16_t ticks(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { return TCNT1; }
    __builtin_unreachable();
}

static void wait(uint16_t time) {
    uint16_t began = ticks();
    while ((uint16_t)(ticks() - began) < time) {
    }
}

// From where the servo is to the goal, both included, a degree at a time.
static void turn(uint8_t servo, int goal) {
    int angle = read(servo), step = goal < angle ? -1 : 1;
    wait(TURN_TICKS);
    for (;; angle += step) {
        write(servo, angle);
        wait(STEP_TICKS);
        if (angle == goal) return;
    }
}

static void take(uint8_t byte) {
    static const char letters[] = "bseg";
    static char digits[DIGITS] = "000";
    static uint8_t servo, digit;
    const char *letter = byte ? strchr(letters, byte) : NULL;
    if (letter) {
        servo = letter - letters;
        digit = 0;
    } else if (byte == ',') {
        char text[DIGITS + 1] = {0};  // ends where the sketch would read on
        memcpy(text, digits, DIGITS);
        turn(servo, atoi(text));
        memcpy(digits, "000", DIGITS);
    } else if (digit < DIGITS) {
        digits[digit++] = byte;
    } else {
        counters[1]++;
    }
}

int main(void) {
    for (uint8_t servo = 0; servo < SERVOS; servo++) write(servo, servo == 3 ? 0 : 90);
    servo_begin();
    UCSR0A = _BV(U2X0);
    UBRR0 = 16;
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0);
    sei();
    for (;;) {
        uint8_t byte;
        if (receive(&byte)) take(byte);
    }
}
