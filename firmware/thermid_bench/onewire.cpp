#include "onewire.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <util/atomic.h>
#include <util/crc16.h>
#include <util/delay.h>

// Open drain: the port's bit stays 0, the direction pulls low or lets go. Times are those of the data sheet of the DS18B20.
static const uint8_t BIT = _BV(PD4);

static inline void low() { DDRD |= BIT; }
static inline void release() { DDRD &= ~BIT; }
static inline uint8_t is_high() { return PIND & BIT; }

Presence bus_reset() {
    PORTD &= ~BIT;
    release();
    _delay_us(5);
    if (!is_high()) return SHORTED;
    low();
    _delay_us(480);
    uint8_t answered;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        release();
        _delay_us(70);
        answered = !is_high();
    }
    _delay_us(410);
    if (!is_high()) return SHORTED;
    return answered ? SOMEBODY : NOBODY;
}

static void write_bit(uint8_t one) {
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        low();
        if (one) {
            _delay_us(6);
            release();
        } else {
            _delay_us(60);
            release();
        }
    }
    if (one) _delay_us(60);
    _delay_us(8);
}

uint8_t bus_read_bit() {
    uint8_t one;
    ATOMIC_BLOCK(ATOMIC_RESTORESTATE) {
        low();
        _delay_us(4);
        release();
        _delay_us(9);
        one = is_high() != 0;
    }
    _delay_us(55);
    return one;
}

void bus_write(uint8_t byte) {
    for (uint8_t k = 0; k < 8; k++, byte >>= 1) write_bit(byte & 1);
}

uint8_t bus_read() {
    uint8_t byte = 0;
    for (uint8_t k = 0; k < 8; k++) byte |= bus_read_bit() << k;
    return byte;
}

uint8_t bus_crc(const uint8_t *bytes, uint8_t count) {
    uint8_t crc = 0;
    while (count--) crc = _crc_ibutton_update(crc, *bytes++);
    return crc;
}

uint8_t bus_search(uint8_t rom[8], uint8_t *fork, uint8_t *last) {
    if (*last || bus_reset() != SOMEBODY) return 0;
    bus_write(0xF0);
    uint8_t zero_at = 0;
    for (uint8_t k = 1; k <= 64; k++) {
        uint8_t mask = 1 << ((k - 1) & 7), *byte = &rom[(k - 1) >> 3];
        uint8_t bit = bus_read_bit(), complement = bus_read_bit();
        if (bit && complement) return 0;  // nobody answers any more
        if (!bit && !complement) {
            // both are there: as before up to the last fork, 1 at it, 0 behind it
            bit = k < *fork ? (*byte & mask) != 0 : k == *fork;
            if (!bit) zero_at = k;
        }
        if (bit) *byte |= mask;
        else *byte &= ~mask;
        write_bit(bit);
    }
    *fork = zero_at;
    *last = zero_at == 0;
    return 1;
}
