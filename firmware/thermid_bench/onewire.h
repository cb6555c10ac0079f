// The 1-Wire bus on pin D4, with 4.7 kohm to 5 V.
#pragma once
#include <stdint.h>

enum Presence : uint8_t { NOBODY, SOMEBODY, SHORTED };

Presence bus_reset();
void bus_write(uint8_t byte);
uint8_t bus_read();
uint8_t bus_read_bit();
uint8_t bus_crc(const uint8_t *bytes, uint8_t count);

// One step of the search for ROMs: `rom` holds the one found before and takes the next. Returns 0 at the end or when the bus
// misbehaves; `fork` is 0 before the first step.
uint8_t bus_search(uint8_t rom[8], uint8_t *fork, uint8_t *last);
