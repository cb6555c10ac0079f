#include "sensors.h"

#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/wdt.h>
#include <string.h>

#include "heaters.h"
#include "lines.h"
#include "onewire.h"

// Two bytes that a sensor keeps until it loses its supply: their absence shows a power-up, whose 85 degC is no temperature.
static const uint8_t SIGN_HIGH = 0x54, SIGN_LOW = 0x4D;

static uint8_t roms[MOST_SENSORS][8];
static uint8_t count, resolution = 12;

static void select(const uint8_t *rom) {
    bus_write(0x55);
    for (uint8_t k = 0; k < 8; k++) bus_write(rom[k]);
}

static void write_settings() {
    bus_write(0x4E);
    bus_write(SIGN_HIGH);
    bus_write(SIGN_LOW);
    bus_write((uint8_t)((resolution - 9) << 5) | 0x1F);
}

static void event(const char *flash, const uint8_t *rom) {
    line_begin('E');
    line_text(flash);
    if (rom) line_hex(rom, 8);
    line_end();
}

void sensors_event(const char *flash, uint8_t sensor) { event(flash, roms[sensor]); }

void sensors_search() {
    uint8_t rom[8], fork, last, tries = 0;
    do {
        memset(rom, 0, sizeof rom);
        count = fork = last = 0;
        Presence found = bus_reset();
        if (found == SHORTED) {
            event(PSTR(",short"), 0);
            return;
        }
        if (found == NOBODY) break;
        while (bus_search(rom, &fork, &last)) {
            wdt_reset();
            if (bus_crc(rom, 8) != 0 || rom[0] != 0x28) {
                if (rom[0] == 0x28) break;  // a bit went wrong: begin again
                continue;                   // another kind of device
            }
            if (count == MOST_SENSORS) {
                event(PSTR(",many"), rom);
                break;
            }
            memcpy(roms[count++], rom, 8);
        }
    } while (!last && count < MOST_SENSORS && ++tries < 3);
    for (uint8_t k = 0; k < count;) {
        bus_reset();
        select(roms[k]);
        bus_write(0xB4);
        if (bus_read_bit()) {
            k++;
            continue;
        }
        // while it converts, such a sensor lives on the bus, and nobody else could use it
        event(PSTR(",parasite"), roms[k]);
        memmove(roms[k], roms[k + 1], (size_t)(--count - k) * 8);
    }
    if (!count) event(PSTR(",none"), 0);
}

void sensors_configure(uint8_t bits) {
    resolution = bits;
    if (bus_reset() != SOMEBODY) return;
    bus_write(0xCC);
    write_settings();
}

void sensors_say() {
    for (uint8_t k = 0; k < count; k++) {
        line_begin('S');
        line_hex(roms[k], 8);
        line_number(resolution);
        line_end();
    }
}

uint8_t sensors_count() { return count; }

uint16_t sensors_conversion(uint8_t bits) { return (750 >> (12 - bits)) + 2; }

void sensors_convert() {
    if (bus_reset() != SOMEBODY) return;
    bus_write(0xCC);
    bus_write(0x44);
}

enum Status : uint8_t { OK, CRC, LOST, SHORT, POWER };
static const char WORDS[][6] PROGMEM = {"ok", "crc", "lost", "short", "power"};

static Status read_one(const uint8_t *rom, int16_t *raw) {
    Status status = LOST;
    for (uint8_t tries = 0; tries < 3; tries++) {
        Presence found = bus_reset();
        if (found != SOMEBODY) return found == SHORTED ? SHORT : LOST;
        select(rom);
        bus_write(0xBE);
        uint8_t pad[9], ones = 0xFF;
        for (uint8_t k = 0; k < 9; k++) ones &= pad[k] = bus_read();
        if (ones == 0xFF) {
            status = LOST;
            continue;
        }
        // nine zeros have a good CRC; the settings of a living sensor end in five ones
        if (bus_crc(pad, 9) != 0 || (pad[4] & 0x1F) != 0x1F) {
            status = CRC;
            continue;
        }
        *raw = (int16_t)(pad[0] | (uint16_t)pad[1] << 8);
        // bits below the resolution are not defined
        *raw &= (int16_t)(0xFFFFu << (3 - ((pad[4] >> 5) & 3)));
        if (pad[2] == SIGN_HIGH && pad[3] == SIGN_LOW) return OK;
        bus_reset();
        select(rom);
        write_settings();
        return POWER;
    }
    return status;
}

uint8_t sensors_read(uint32_t at, bool send, int16_t limit, uint8_t *hot) {
    uint8_t good = 0;
    for (uint8_t k = 0; k < count; k++) {
        wdt_reset();
        int16_t raw = 0;
        Status status = read_one(roms[k], &raw);
        if (status == OK) {
            good++;
            if (raw >= limit && *hot == NO_SENSOR) {
                *hot = k;
                if (heaters_on()) heaters_cut(HOT);
            }
        }
        if (!send) continue;
        line_begin_at('D', at);
        line_hex(roms[k], 8);
        if (status == OK || status == POWER) line_number(raw);
        else line_char(',');
        line_char(',');
        line_text(WORDS[status]);
        line_end();
    }
    return good;
}
