// UART 0 at 115200 baud, 8N1. Interrupts send and receive the bytes; no function waits.

#pragma once

#include <stdbool.h>
#include <stdint.h>

// Replaces lost bytes, so that the rest of their frame is never accepted. The protocol has no such
// byte.
#define SERIAL_GAP 0xff

// Number of lost bytes: no room, overrun, or framing error.
extern volatile uint16_t serial_lost;

void serial_begin(void);

// Return true if there is a byte to read.
bool serial_ready(void);

// Return the next byte. Call this only if serial_ready() is true.
uint8_t serial_read(void);

// Return the number of bytes that can be written now.
uint8_t serial_room(void);

// Write a byte. The byte is dropped if there is no room.
void serial_write(uint8_t byte);
