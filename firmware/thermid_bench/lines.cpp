#include "lines.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <stdlib.h>
#include <string.h>
#include <util/crc16.h>

#include "clock.h"

static uint16_t crc;
static uint32_t number;

static volatile uint8_t ring[256];  // its indices wrap by themselves
static volatile uint8_t head;
static uint8_t tail;
static char line[64];
static uint8_t length;

ISR(USART_RX_vect) {
    uint8_t c = UDR0;
    if ((uint8_t)(head + 1) != tail) ring[head++] = c;
}

void lines_begin() {
    UCSR0A = _BV(U2X0);
    UBRR0 = 16;  // 115200 baud, 2.1 % fast, as every Uno has it
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
}

static void put(char c) {
    while (!(UCSR0A & _BV(UDRE0))) {
    }
    UDR0 = c;
}

void line_char(char c) {
    crc = _crc_xmodem_update(crc, (uint8_t)c);
    put(c);
}

void line_text(const char *flash) {
    for (char c; (c = pgm_read_byte(flash)) != 0; flash++) line_char(c);
}

static void unsigned_number(uint32_t value) {
    char text[12];
    ultoa(value, text, 10);
    for (char *c = text; *c; c++) line_char(*c);
}

void line_number(int32_t value) {
    line_char(',');
    if (value < 0) line_char('-');
    unsigned_number(value < 0 ? -value : value);
}

static char digit(uint8_t value) { return value < 10 ? '0' + value : 'A' + value - 10; }

void line_hex(const uint8_t *bytes, uint8_t count) {
    line_char(',');
    for (uint8_t k = 0; k < count; k++) {
        line_char(digit(bytes[k] >> 4));
        line_char(digit(bytes[k] & 15));
    }
}

void line_begin_at(char kind, uint32_t ms) {
    crc = 0xFFFF;
    line_char(kind);
    line_char(',');
    unsigned_number(number++);
    line_char(',');
    unsigned_number(ms);
}

void line_begin(char kind) { line_begin_at(kind, clock_ms()); }

void line_end() {
    put('*');
    for (int8_t shift = 12; shift >= 0; shift -= 4) put(digit((crc >> shift) & 15));
    put('\n');
}

uint32_t lines_sent() { return number; }

char *line_received() {
    while (tail != head) {
        char c = ring[tail++];
        if (c == '\r') continue;
        if (c != '\n') {
            if (length < sizeof line - 1) line[length] = c;
            if (length < 255) length++;
            continue;
        }
        uint8_t count = length;
        length = 0;
        uint16_t sum = 0xFFFF;
        if (count >= sizeof line || count < 6 || line[count - 5] != '*') {
            line[0] = 0;
            return line;
        }
        for (uint8_t k = 0; k < count - 5; k++) sum = _crc_xmodem_update(sum, (uint8_t)line[k]);
        for (uint8_t k = 0; k < 4; k++) {
            if (line[count - 4 + k] != digit((sum >> (12 - 4 * k)) & 15)) {
                line[0] = 0;
                return line;
            }
        }
        line[count - 5] = 0;
        return line;
    }
    return 0;
}
