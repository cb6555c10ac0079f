// thermid bench: DS18B20 sensors, two heaters, one supply monitor on an Arduino Uno or Nano (ATmega328P, 16 MHz).
// It needs no library. The line protocol and the wiring are described in docs/bench.md.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <avr/wdt.h>

#include "clock.h"
#include "commands.h"
#include "heaters.h"
#include "lines.h"
#include "sensors.h"
#include "supply.h"

// Why the board began: read before anything else, because a watchdog that is still armed would strike again within 16 ms.
static uint8_t cause __attribute__((section(".noinit")));

extern "C" void read_cause(void) __attribute__((naked, used, section(".init3")));
extern "C" void read_cause(void) {
    cause = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

static void say_board() {
    line_begin('B');
    line_text(PSTR(",atmega328p,thermid-bench 1,"));
    line_text(cause & _BV(WDRF)    ? PSTR("watchdog")
              : cause & _BV(BORF)  ? PSTR("brown-out")
              : cause & _BV(EXTRF) ? PSTR("external")
              : cause & _BV(PORF)  ? PSTR("power")
                                   : PSTR("unknown"));
    line_end();
}

static void identify() {
    say_board();
    sensors_say();
    line_begin('C');
    line_number(settings.interval);
    line_number(settings.limit);
    line_number(settings.silence);
    line_end();
    if (heaters_refuse() == NONE) return;
    line_begin('E');
    line_text(heaters_refuse() == HOT ? PSTR(",latched,overtemp") : PSTR(",latched,blind"));
    line_end();
}

// Look for sensors; the bus must be at rest.
static void look() {
    sensors_search();
    sensors_configure(settings.bits);
}

static uint32_t next_cycle, next_report;

// The next conversion ends when a report is due, with a heater on once a second at least.
static void plan() {
    uint32_t now = clock_ms();
    uint16_t needed = sensors_conversion(settings.bits);
    if ((int32_t)(next_report - now) < (int32_t)needed) next_report = now + needed;
    if ((int32_t)(next_report - now) > (int32_t)settings.interval) next_report = now + settings.interval;
    next_cycle = next_report;
    if (heaters_on() && (int32_t)(next_cycle - now) > 1000) next_cycle = now + 1000;
}

static void read_out(uint32_t at) {
    bool send = (int32_t)(at - next_report) >= 0;
    uint8_t hot = NO_SENSOR;
    uint8_t good = sensors_read(at, send, settings.limit, &hot);
    if (send) {
        heaters_say(at);
        supply_say(at);
        next_report += settings.interval;
    }
    if (heaters_on() && (hot != NO_SENSOR || (good == 0 && sensors_count() != 0))) {
        heaters_cut(hot != NO_SENSOR ? HOT : BLIND);
    }
    if (hot != NO_SENSOR && heaters_were_cut()) sensors_event(PSTR(",overtemp"), hot);
    heaters_tell();
}

int main(void) {
    wdt_enable(WDTO_2S);
    clock_begin();
    lines_begin();
    heaters_begin();
    supply_begin();
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();
    look();
    identify();
    uint32_t end = 0;
    bool converting = false;
    next_report = clock_ms() + 1000;
    plan();
    for (;;) {
        wdt_reset();
        uint32_t now = clock_ms();
        if (!converting && (int32_t)(now + sensors_conversion(settings.bits) - next_cycle) >= 0) {
            end = now + sensors_conversion(settings.bits);
            sensors_convert();
            converting = true;
        }
        if (converting && (int32_t)(now - end) >= 0) {
            converting = false;
            read_out(now);
            plan();
        }
        if (commands_take()) {
            if (!converting) plan();
            else if (heaters_on() && (int32_t)(next_report - now) > 1000) next_cycle = now + 1000;
        }
        if (heaters_on() && clock_ms() - commands_heard() >= settings.silence) {
            heaters_cut(SILENT);
            heaters_tell();
        }
        // what needs the bus waits until no sensor is busy
        if (!converting && commands_wants(WANTS_BITS)) sensors_configure(settings.bits);
        if (!converting && commands_wants(WANTS_SEARCH)) {
            look();
            identify();
        }
        if (commands_wants(WANTS_IDENTITY)) identify();
        sleep_mode();
    }
}
