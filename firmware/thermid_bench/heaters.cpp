#include "heaters.h"

#include <avr/io.h>
#include <avr/pgmspace.h>

#include "clock.h"
#include "lines.h"

static uint16_t duties[2];
static Reason latched, untold;

static const uint16_t TOP = 999;
static const uint8_t MODE = _BV(WGM11);  // with those of TCCR1B: fast PWM up to ICR1

void heaters_begin() {
    ICR1 = TOP;
    TCCR1A = MODE;
    TCCR1B = _BV(WGM13) | _BV(WGM12) | _BV(CS11) | _BV(CS10);  // 16 MHz / 64 / 1000 = 250 Hz
    DDRB |= _BV(PB1) | _BV(PB2);
}

bool heaters_on() { return duties[0] || duties[1]; }

Reason heaters_refuse() { return latched; }

void heaters_set(uint8_t heater, uint16_t duty) {
    duties[heater] = duty;
    uint8_t by_timer = heater ? _BV(COM1B1) : _BV(COM1A1);
    if (duty == 0) {
        // this PWM has no duty of zero: its pin is taken off it, and is low at once
        TCCR1A &= ~by_timer;
        return;
    }
    if (heater) OCR1B = duty - 1;
    else OCR1A = duty - 1;
    TCCR1A |= by_timer;
}

void heaters_clear() { latched = NONE; }

void heaters_cut(Reason why) {
    heaters_set(0, 0);
    heaters_set(1, 0);
    if (why != SILENT) latched = why;  // a host that is heard again may heat
    untold = why;
}

bool heaters_were_cut() { return untold != NONE; }

void heaters_tell() {
    if (untold == NONE) return;
    if (untold != HOT) {
        line_begin('E');
        line_text(untold == BLIND ? PSTR(",blind") : PSTR(",silent"));
        line_end();
    }
    untold = NONE;
    heaters_say(clock_ms());
}

void heaters_say(uint32_t at) {
    for (uint8_t k = 0; k < 2; k++) {
        line_begin_at('D', at);
        line_text(k ? PSTR(",H2") : PSTR(",H1"));
        line_number(duties[k]);
        line_text(PSTR(",ok"));
        line_end();
    }
}
