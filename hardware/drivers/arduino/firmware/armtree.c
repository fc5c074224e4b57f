// armtree: four servos by frames such as b090,s090,e090,g000, over a serial line.
//
// For the ATmega328P at 16 MHz of an Uno or Nano. README.md describes the protocol. One loop does
// everything and never waits: interrupts transfer bytes and make the pulses.

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <string.h>
#include <util/atomic.h>
#include <util/crc16.h>

#include "held.h"
#include "serial.h"
#include "servo.h"

#define BANNER "\narmtree 1 AVW? "  // on a new line, because a reset may have cut a line short
#define CYCLE_MS 20
#define CYCLES_PER_S (1000 / CYCLE_MS)
#define ANGLE_MAX 180
#define ONE_DEGREE 256
#define BANNER_LENGTH 42  // line feeds included
#define ACK_LENGTH 17
#define STATUS_LENGTH 131

static const char letters[SERVOS] = {'b', 's', 'e', 'g'};
static const uint8_t boot_angles[SERVOS] = {90, 90, 90, 0};

// Goals and present positions of the servos [1/256 deg]; 256 * 180 fits.
static uint16_t goals[SERVOS], places[SERVOS];
static uint16_t speeds[SERVOS];  // [deg/s], 0 for no limit

// Counters since boot; all wrap.
static uint16_t frames, refused, sum;
static uint8_t holds;

// Lines to send as soon as there is room. Two requests for a waiting line get one answer.
static bool acks, ack_due, status_due, banner_due = true;
static bool recalled;

static uint16_t watchdog_ms, silence_ms;  // 0 for no watchdog

static uint16_t step_of(uint16_t speed) { return (uint32_t)speed * ONE_DEGREE / CYCLES_PER_S; }

static void rounded(uint8_t angles[SERVOS]) {
    for (uint8_t i = 0; i < SERVOS; i++) angles[i] = (places[i] + ONE_DEGREE / 2) / ONE_DEGREE;
}

// Servos --------------------------------------------------------------------------------------

static void set_pulses(void) {
    uint16_t us[SERVOS];
    for (uint8_t i = 0; i < SERVOS; i++) us[i] = servo_us(places[i]);
    servo_pulses(us);
}

static void hold(void) {
    memcpy(goals, places, sizeof goals);
    holds++;
    status_due = true;
}

// Once per cycle: move the servos a step towards their goals, and store their positions.
static void advance(void) {
    static uint8_t before[SERVOS] = {0xff};
    for (uint8_t i = 0; i < SERVOS; i++) {
        uint16_t step = speeds[i] ? step_of(speeds[i]) : UINT16_MAX;
        bool up = goals[i] > places[i];
        uint16_t way = up ? goals[i] - places[i] : places[i] - goals[i];
        if (way > step) way = step;
        places[i] += up ? way : -way;
    }
    set_pulses();
    uint8_t angles[SERVOS];
    rounded(angles);
    if (memcmp(angles, before, SERVOS)) {
        memcpy(before, angles, SERVOS);
        held_store(angles);
    }
}

static void watch(void) {
    if (!watchdog_ms || silence_ms > watchdog_ms) return;
    silence_ms += CYCLE_MS;
    if (silence_ms > watchdog_ms) hold();
}

// Received bytes ------------------------------------------------------------------------------

static void take_frame(const uint8_t angles[SERVOS]) {
    for (uint8_t i = 0; i < SERVOS; i++) {
        goals[i] = angles[i] * ONE_DEGREE;
        sum = _crc_xmodem_update(sum, angles[i]);
    }
    frames++;
    silence_ms = 0;
    ack_due = acks;
}

// Return false if the command is unknown.
static bool take_command(uint8_t servo, char name, uint8_t value) {
    if (name == 'V') {
        speeds[servo] = value * 10;
    } else if (name == 'W' && servo == 0) {
        watchdog_ms = value * 100;
    } else if (name == 'A' && servo == 0 && value <= 1) {
        acks = value;
    } else {
        return false;
    }
    silence_ms = 0;
    status_due = true;
    return true;
}

static uint8_t servo_of(uint8_t byte) {
    uint8_t servo = 0;
    while (servo < SERVOS && letters[servo] != byte) servo++;
    return servo;
}

// A field is a letter, three digits and a comma. Four fields in order are a frame, which is accepted
// only as a whole. A command is a letter, a capital, two digits and a semicolon. It differs from any
// field in two bytes, so that a single damaged byte never turns a field into a command. A byte that
// does not fit drops the bytes before it, and may then begin a frame or command.
static void take(uint8_t byte) {
    static uint8_t angles[SERVOS];
    static uint8_t fields;  // complete fields of the frame so far
    static uint8_t held;    // bytes of the field or command so far
    static uint8_t servo;
    static uint8_t command;  // its capital letter; 0 in a field
    static uint16_t value;

    if (held == 0) {
        servo = servo_of(byte);
        if (fields ? servo == fields : servo < SERVOS) {
            command = value = 0;
            held++;
            return;
        }
    } else if (held == 1 && fields == 0 && byte >= 'A' && byte <= 'Z') {
        command = byte;
        held++;
        return;
    } else if (held < 4 && byte >= '0' && byte <= '9') {
        value = value * 10 + (byte - '0');
        held++;
        return;
    } else if (held == 4 && command) {
        if (byte == ';' && take_command(servo, command, value)) {
            held = 0;
            return;
        }
    } else if (held == 4 && byte == ',' && servo == fields && value <= ANGLE_MAX) {
        held = 0;
        angles[fields++] = value;
        if (fields == SERVOS) {
            fields = 0;
            take_frame(angles);
        }
        return;
    }
    bool first = held == 0 && fields == 0;
    refused += fields * 5 + held;
    fields = held = 0;
    if (!first) {
        take(byte);
    } else if (byte == '?') {
        silence_ms = 0;
        status_due = true;
    } else {
        refused++;
    }
}

// Sent lines ----------------------------------------------------------------------------------

static void say(const char *text) {
    while (*text) serial_write(*text++);
}

static void say_hex(uint16_t value, uint8_t digits) {
    while (digits--) serial_write("0123456789abcdef"[value >> digits * 4 & 0xf]);
}

static void say_decimal(uint16_t value, uint8_t digits) {
    if (digits > 1) say_decimal(value / 10, digits - 1);
    serial_write('0' + value % 10);
}

static void say_place(void) {
    uint8_t angles[SERVOS];
    rounded(angles);
    for (uint8_t i = 0; i < SERVOS; i++) {
        serial_write(letters[i]);
        say_decimal(angles[i], 3);
        serial_write(',');
    }
    serial_write('\n');
}

static void say_banner(void) {
    say(BANNER);
    say(recalled ? "kept " : "boot ");
    say_place();
}

static uint16_t lost(void) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { return serial_lost; }
    __builtin_unreachable();
}

static void say_ack(void) {
    serial_write('k');
    say_hex(frames, 4);
    serial_write(',');
    say_hex(refused, 2);
    serial_write(',');
    say_hex(lost(), 2);
    serial_write(',');
    say_hex(sum, 4);
    serial_write('\n');
}

static void say_status(void) {
    say("status frames=");
    say_hex(frames, 4);
    say(" refused=");
    say_hex(refused, 4);
    say(" lost=");
    say_hex(lost(), 4);
    say(" sum=");
    say_hex(sum, 4);
    say(" holds=");
    say_hex(holds, 2);
    say(" acks=");
    serial_write('0' + acks);
    say(" watchdog_ms=");
    say_decimal(watchdog_ms, 4);
    say(" speeds=");
    for (uint8_t i = 0; i < SERVOS; i++) {
        if (i) serial_write(',');
        say_decimal(speeds[i], 3);
    }
    say(" at=");
    say_place();
}

static bool say_if(bool *due, uint8_t length, void (*line)(void)) {
    if (!*due || serial_room() < length) return false;
    *due = false;
    line();
    return true;
}

static bool speak(void) {
    return say_if(&banner_due, BANNER_LENGTH, say_banner) ||
           say_if(&ack_due, ACK_LENGTH, say_ack) ||
           say_if(&status_due, STATUS_LENGTH, say_status);
}

// ---------------------------------------------------------------------------------------------

static void begin(void) {
    MCUSR = 0;
    wdt_disable();  // a boot loader may have left it on
    serial_begin();
    sei();
    uint8_t angles[SERVOS];
    recalled = held_recall(angles);
    if (!recalled) memcpy(angles, boot_angles, SERVOS);
    held_store(angles);
    for (uint8_t i = 0; i < SERVOS; i++) goals[i] = places[i] = angles[i] * ONE_DEGREE;
    set_pulses();
    servo_begin();
    set_sleep_mode(SLEEP_MODE_IDLE);
}

// Sleep until an interrupt. Return at once if an interrupt has left work to do.
static void rest(void) {
    cli();
    if (serial_ready() || servo_due) {
        sei();
        return;
    }
    sleep_enable();
    sei();  // takes effect after the next instruction, so no interrupt can come in between
    sleep_cpu();
    sleep_disable();
}

int main(void) {
    begin();
    for (;;) {
        if (serial_ready()) take(serial_read());
        if (servo_due) {
            servo_due = false;
            watch();
            advance();
        }
        if (!speak()) rest();
    }
}
