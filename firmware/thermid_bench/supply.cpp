#include "supply.h"

#include <avr/io.h>
#include <avr/pgmspace.h>
#include <stdbool.h>

#include "lines.h"

static const uint8_t ADDRESS = 0x40 << 1;
static bool there;

// One step of the bus; false when it does not end within a millisecond, as with a wire that is held low.
static bool step(uint8_t control) {
    TWCR = control | _BV(TWINT) | _BV(TWEN);
    for (uint16_t k = 0; k < 2000; k++) {
        if (TWCR & _BV(TWINT)) return true;
    }
    TWCR = 0;
    return false;
}

// A byte; whether it was acknowledged, by none of the states that say no (table 21-3 of the data sheet).
static bool send(uint8_t byte) {
    TWDR = byte;
    if (!step(0)) return false;
    uint8_t state = TWSR & 0xF8;
    return state != 0x20 && state != 0x30 && state != 0x38 && state != 0x48 && state != 0;
}

static void stop() { TWCR = _BV(TWINT) | _BV(TWSTO) | _BV(TWEN); }

// 32 V, 320 mV, always measuring, each result the mean of 128 readings in 68 ms: seventeen periods of the heaters' PWM. A single reading,
// as after power-up, takes half a millisecond and would catch the heater either on or off.
static const uint16_t SETTINGS = 0x3FFF;

static bool configure() {
    bool good = step(_BV(TWSTA)) && send(ADDRESS) && send(0) && send(SETTINGS >> 8) && send(SETTINGS & 0xFF);
    stop();
    return good;
}

static bool read(uint8_t address, uint16_t *value) {
    bool good = step(_BV(TWSTA)) && send(ADDRESS) && send(address) && step(_BV(TWSTA)) && send(ADDRESS | 1);
    if (good) {
        good = step(_BV(TWEA));
        *value = (uint16_t)TWDR << 8;
        good = good && step(0);
        *value |= TWDR;
    }
    stop();
    return good;
}

void supply_begin() {
    PORTC |= _BV(PC4) | _BV(PC5);
    TWBR = 72;  // 100 kHz
    there = configure();
}

static void say(uint32_t at, const char *source, int32_t value, bool good) {
    line_begin_at('D', at);
    line_text(source);
    if (good) line_number(value);
    else line_char(',');
    line_text(good ? PSTR(",ok") : PSTR(",lost"));
    line_end();
}

void supply_say(uint32_t at) {
    if (!there) return;
    uint16_t set = 0, shunt = 0, bus = 0;
    bool good = read(0, &set) && set == SETTINGS && read(1, &shunt) && read(2, &bus);
    if (!good) configure();  // it was without supply, and has forgotten
    say(at, PSTR(",V1"), (int32_t)(bus >> 3) * 4, good);
    say(at, PSTR(",I1"), (int16_t)shunt, good);  // 10 uV over 0.1 ohm are 0.1 mA
}
