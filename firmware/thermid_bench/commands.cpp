#include "commands.h"

#include <avr/pgmspace.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "heaters.h"
#include "lines.h"

Settings settings = {12, 1000, 2000, 1600};

static uint32_t heard;
static uint8_t wants;

uint32_t commands_heard() { return heard; }

bool commands_wants(uint8_t what) {
    bool asked = wants & what;
    wants &= ~what;
    return asked;
}

// Up to two whole numbers behind the word; more than two, or text, give 9.
static uint8_t arguments(char *text, int32_t values[2]) {
    uint8_t count = 0;
    while (text) {
        char *next = strchr(text, ','), *end;
        if (next) *next++ = 0;
        int32_t value = strtol(text, &end, 10);
        if (count == 2 || end == text || *end) return 9;
        values[count++] = value;
        text = next;
    }
    return count;
}

static bool between(int32_t value, int32_t low, int32_t high) { return low <= value && value <= high; }

// Does it; returns ok or why not.
static const char *obey(const char *word, uint8_t count, const int32_t *v) {
    static const char OK[] PROGMEM = ",ok", RANGE[] PROGMEM = ",out of range", UNKNOWN[] PROGMEM = ",unknown";
    if (count == 9) return PSTR(",not a number");
    if (!strcmp_P(word, PSTR("alive"))) return OK;
    if (!strcmp_P(word, PSTR("identify"))) return wants |= WANTS_IDENTITY, OK;
    if (!strcmp_P(word, PSTR("search"))) return wants |= WANTS_SEARCH, OK;
    if (!strcmp_P(word, PSTR("count"))) return OK;
    if (!strcmp_P(word, PSTR("clear"))) return heaters_clear(), OK;
    if (!strcmp_P(word, PSTR("heater"))) {
        if (count != 2 || !between(v[0], 1, 2) || !between(v[1], 0, 1000)) return RANGE;
        if (v[1] && heaters_refuse() != NONE) return heaters_refuse() == HOT ? PSTR(",overtemp") : PSTR(",blind");
        return heaters_set(v[0] - 1, v[1]), OK;
    }
    if (count != 1) return UNKNOWN;
    if (!strcmp_P(word, PSTR("resolution"))) {
        if (!between(v[0], 9, 12)) return RANGE;
        return settings.bits = v[0], wants |= WANTS_BITS, OK;
    }
    if (!strcmp_P(word, PSTR("interval"))) return between(v[0], 100, 3600000) ? (settings.interval = v[0], OK) : RANGE;
    if (!strcmp_P(word, PSTR("silence"))) return between(v[0], 200, 3600000) ? (settings.silence = v[0], OK) : RANGE;
    if (!strcmp_P(word, PSTR("limit"))) return between(v[0], -880, 2000) ? (settings.limit = v[0], OK) : RANGE;
    return UNKNOWN;
}

bool commands_take() {
    bool good = false;
    for (char *text; (text = line_received()) != 0;) {
        char *word = strchr(text, ',');
        int32_t number = strtol(text, 0, 10);
        if (!*text || !word || number < 0) {
            line_begin('E');
            line_text(PSTR(",garbled"));
            line_end();
            continue;
        }
        *word++ = 0;
        char *rest = strchr(word, ',');
        if (rest) *rest++ = 0;
        int32_t values[2] = {0, 0};
        const char *answer = obey(word, arguments(rest, values), values);
        heard = clock_ms();
        good = true;
        if (number) {
            line_begin('R');
            line_number(number);
            line_text(answer);
            line_end();
        }
        if (!strcmp_P(word, PSTR("count"))) {
            line_begin('E');
            line_text(PSTR(",count"));
            line_number(lines_sent() - 1);
            line_end();
        }
        if (!strcmp_P(word, PSTR("heater"))) heaters_say(clock_ms());
    }
    return good;
}
