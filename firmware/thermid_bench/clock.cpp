#include "clock.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>

static volatile uint32_t ticks;

ISR(TIMER2_COMPA_vect) { ticks++; }

void clock_begin() {
    TCCR2A = _BV(WGM21);  // counts to OCR2A and begins again
    TCCR2B = _BV(CS22);   // 16 MHz / 64 = 250 kHz
    OCR2A = 249;
    TIMSK2 = _BV(OCIE2A);
}

uint32_t clock_ms() {
    uint32_t now;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) { now = ticks; }
    return now;
}
