// UART 0 at 115200 baud, 8N1, both ways by interrupt; nothing here ever waits.

#pragma once

#include <stdbool.h>
#include <stdint.h>

// Stands in for bytes that were lost, so that what is left of their frame cannot pass for a whole
// one. It is no byte of the protocol.
#define SERIAL_GAP 0xff

// Bytes that were lost: no room, overrun, or framing error.
extern volatile uint16_t serial_lost;

void serial_begin(void);

// Is there a byte to read?
bool serial_ready(void);

// The next byte; only when there is one.
uint8_t serial_read(void);

// How many bytes can be written now.
uint8_t serial_room(void);

// Write a byte; dropped where there is no room.
void serial_write(uint8_t byte);
