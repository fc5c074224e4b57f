// UART 0 at 115200 baud, 8N1, both ways by interrupt; no function waits.

#pragma once

#include <stdbool.h>
#include <stdint.h>

// Replaces lost bytes, so that the rest of their frame is never accepted. It is no byte of the
// protocol.
#define SERIAL_GAP 0xff

// Bytes that were lost: no room, overrun, or framing error.
extern volatile uint16_t serial_lost;

void serial_begin(void);

// Whether there is a byte to read.
bool serial_ready(void);

// The next byte. Call it only if there is one.
uint8_t serial_read(void);

// Number of bytes that can be written now.
uint8_t serial_room(void);

// Write a byte. It is dropped if there is no room.
void serial_write(uint8_t byte);
