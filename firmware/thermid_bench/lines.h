// Lines to and from the host, with CRC-16.
#pragma once
#include <stdint.h>

void lines_begin();

// A line goes out as it is made: kind, number, time, then fields with their commas, then the CRC.
void line_begin(char kind);
void line_begin_at(char kind, uint32_t ms);
void line_text(const char *flash);
void line_char(char c);
void line_number(int32_t value);
void line_hex(const uint8_t *bytes, uint8_t count);
void line_end();
uint32_t lines_sent();

// The next line of the host without its CRC, or null; an empty text for one that was garbled.
char *line_received();
