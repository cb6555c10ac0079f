#include "heaters.h"

#include <avr/io.h>
#include <avr/pgmspace.h>

#include "clock.h"
#include "lines.h"

static uint16_t duties[2];
static Reason latched, untold;

void heaters_begin() {
    // phase correct PWM up to 1000, so that a duty of 0 is no pulse at all: 16 MHz / 64 / 2000 = 125 Hz
    ICR1 = 1000;
    OCR1A = OCR1B = 0;
    TCCR1A = _BV(COM1A1) | _BV(COM1B1) | _BV(WGM11);
    TCCR1B = _BV(WGM13) | _BV(CS11) | _BV(CS10);
    DDRB |= _BV(PB1) | _BV(PB2);
}

bool heaters_on() { return duties[0] || duties[1]; }

Reason heaters_refuse() { return latched; }

void heaters_set(uint8_t heater, uint16_t duty) {
    duties[heater] = duty;
    if (heater) OCR1B = duty;
    else OCR1A = duty;
}

void heaters_clear() { latched = NONE; }

void heaters_cut(Reason why) {
    heaters_set(0, 0);
    heaters_set(1, 0);
    // the counter takes a new duty at its top; the pins go low now
    TCCR1A = _BV(WGM11);
    PORTB &= ~(_BV(PB1) | _BV(PB2));
    TCCR1A = _BV(COM1A1) | _BV(COM1B1) | _BV(WGM11);
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
