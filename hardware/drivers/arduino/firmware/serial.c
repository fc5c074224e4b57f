#include "serial.h"

#include <avr/interrupt.h>
#include <avr/io.h>

// Each buffer has 256 slots, so that its 8-bit indices wrap at the end and never point outside. Each
// index is a single byte with one writer, so no lock is needed.
static volatile uint8_t received[256], received_end, received_start;
static volatile uint8_t sent[256], sent_end, sent_start;

volatile uint16_t serial_lost;

void serial_begin(void) {
    UCSR0A = _BV(U2X0);  // before the divisor, as the Arduino core does
    UBRR0 = 16;          // 16 MHz / 8 / 17 = 117647 baud, 2.1 % fast: within the tolerance of 8N1
    UCSR0B = _BV(RXCIE0) | _BV(RXEN0) | _BV(TXEN0);
}

bool serial_ready(void) { return received_start != received_end; }

uint8_t serial_read(void) { return received[received_start++]; }

uint8_t serial_room(void) { return sent_start - sent_end - 1; }

void serial_write(uint8_t byte) {
    if (!serial_room()) return;
    sent[sent_end] = byte;
    sent_end++;  // only now may the interrupt see it
    UCSR0B |= _BV(UDRIE0);
}

ISR(USART_RX_vect) {
    static bool gap;
    bool damaged = UCSR0A & (_BV(FE0) | _BV(DOR0));  // belongs to the byte that is read next
    uint8_t byte = UDR0, end = received_end;
    if ((uint8_t)(end + 1) == received_start) {
        gap = true;
        serial_lost++;
        return;
    }
    if (damaged || gap) {
        gap = false;
        serial_lost++;
        byte = SERIAL_GAP;
    }
    received[end] = byte;
    received_end = end + 1;
}

ISR(USART_UDRE_vect) {
    uint8_t start = sent_start;
    if (start == sent_end) {
        UCSR0B &= ~_BV(UDRIE0);
    } else {
        UDR0 = sent[start];
        sent_start = start + 1;
    }
}
