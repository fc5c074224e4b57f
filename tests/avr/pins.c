#include "pins.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "avr_ioport.h"

#define SERVOS 4
#define NO_ANGLE 181

typedef struct {
    avr_cycle_count_t up;
    double us, period_us;
    unsigned long pulses;
    bool seen[NO_ANGLE + 1];  // whole degrees since the last report, and what is none
    double off_us;            // farthest from a whole degree since the last report
} Servo;

static Servo servos[SERVOS];

static int degrees(double us, double *off) {
    int angle = lround((us - 544) * 180 / 1856);
    if (angle < 0 || angle > 180) angle = angle < 0 ? 0 : 180;
    *off = us - (544 + angle * 1856 / 180);
    return fabs(*off) <= 2 ? angle : NO_ANGLE;
}

static void pin(avr_irq_t *irq, uint32_t level, void *parameter) {
    (void)irq;
    Servo *servo = parameter;
    static avr_cycle_count_t began[SERVOS];
    if (level && !servo->up) {
        avr_cycle_count_t *last = &began[servo - servos];
        if (*last) servo->period_us = (avr->cycle - *last) * 1e6 / HZ;
        *last = servo->up = avr->cycle;
    } else if (!level && servo->up) {
        double off;
        servo->us = (avr->cycle - servo->up) * 1e6 / HZ;
        servo->up = 0;
        servo->pulses++;
        servo->seen[degrees(servo->us, &off)] = true;
        if (fabs(off) > fabs(servo->off_us)) servo->off_us = off;
    }
}

void pins_watch(void) {
    for (int i = 0; i < SERVOS; i++) {
        avr_irq_register_notify(
            avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), i), pin, &servos[i]);
    }
}

void pins_idle(void) {
    for (int i = 0; i < SERVOS; i++) servos[i].up = 0;
}

void pins_report(void) {
    double off;
    for (int i = 0; i < SERVOS; i++) {
        Servo *servo = &servos[i];
        int angle = servo->pulses ? degrees(servo->us, &off) : NO_ANGLE;
        printf("%s{\"angle\": ", i ? ", " : "");
        printf(angle == NO_ANGLE ? "null" : "%d", angle);
        printf(", \"us\": %.2f, \"period_us\": %.2f, \"pulses\": %lu, \"off_us\": %.2f, \"seen\": [",
               servo->us, servo->period_us, servo->pulses, servo->off_us);
        const char *comma = "";
        for (int degree = 0; degree <= NO_ANGLE; degree++) {
            if (!servo->seen[degree]) continue;
            printf("%s%d", comma, degree);
            comma = ", ";
        }
        printf("]}");
        memset(servo->seen, 0, sizeof servo->seen);
        servo->off_us = 0;
    }
}
