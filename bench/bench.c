// The firmware of the bench in a simulator: an ATmega328P (libsimavr), DS18B20 sensors on one wired-AND bus, an INA219, the UART on a
// pseudo-terminal. A separate program for tests; docs/bench.md says how it is driven. It links libsimavr, which is under the GPL 3,
// and so is this program once it is linked.
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_twi.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/sim_time.h>

enum { MOST = 16, BUS = 4, CYCLES_MS = 16000 };
enum { R_DDRB = 0x24, R_MCUSR = 0x54, R_TCCR1A = 0x80, R_ICR1 = 0x86, R_OCR1 = 0x88 };

// ---- sensors ------------------------------------------------------------------------------------------------------------------------

typedef enum { DEAF, ROM_COMMAND, SEARCH, MATCH, FUNCTION, SENDING, SETTINGS, STATUS } state_t;
typedef enum { GOOD, BAD_CRC, LOST, POWER, PARASITE } fault_t;

typedef struct {
    uint8_t rom[8], pad[9], settings[3];
    int16_t raw;
    state_t state;
    unsigned bit, phase;
    uint8_t byte;
    fault_t fault;
    avr_cycle_count_t converted;  // when the conversion ends, 0 for none
} sensor_t;

static avr_t *avr;
static sensor_t sensors[MOST];
static int count = 3;
static bool master_low, shorted, parasite_seen;
static avr_cycle_count_t fell, low_until, presence_from, presence_until;
static avr_irq_t *bus_pin;

static uint8_t crc8(const uint8_t *bytes, int n) {
    uint8_t crc = 0;
    for (int k = 0; k < n; k++)
        for (int b = 0; b < 8; b++) crc = (crc >> 1) ^ (((crc ^ (bytes[k] >> b)) & 1) ? 0x8C : 0);
    return crc;
}

static void power_up(sensor_t *s) {
    static const uint8_t fresh[8] = {0x50, 0x05, 0x4B, 0x46, 0x7F, 0xFF, 0x0C, 0x10};
    memcpy(s->pad, fresh, 8);
    s->state = DEAF;
    s->converted = 0;
}

static void finish_conversion(sensor_t *s) {
    if (!s->converted || avr->cycle < s->converted) return;
    s->converted = 0;
    if (s->fault == POWER) {
        power_up(s);  // its supply failed in the middle
        return;
    }
    int step = 8 >> ((s->pad[4] >> 5) & 3);  // 9 bits: 1/2 K
    int raw = s->raw >= 0 ? (s->raw + step / 2) / step * step : -((-s->raw + step / 2) / step * step);
    s->pad[0] = raw & 0xFF;
    s->pad[1] = (raw >> 8) & 0xFF;
}

static bool present(const sensor_t *s) { return s->fault != LOST; }

// The bit that a sensor sends in this slot; 1 lets the bus go.
static bool sends(sensor_t *s) {
    if (s->state == SEARCH && s->phase < 2) return ((s->rom[s->bit >> 3] >> (s->bit & 7)) & 1) ^ s->phase;
    if (s->state == SENDING && s->bit < 72) return (s->pad[s->bit >> 3] >> (s->bit & 7)) & 1;
    if (s->state == STATUS) return s->fault != PARASITE;
    return true;
}

static void command(sensor_t *s) {
    uint8_t c = s->byte;
    s->bit = s->phase = 0;
    if (s->state == ROM_COMMAND) {
        s->state = c == 0xF0 ? SEARCH : c == 0x55 ? MATCH : c == 0xCC ? FUNCTION : DEAF;
        return;
    }
    finish_conversion(s);
    s->state = DEAF;
    if (c == 0x44) s->converted = avr->cycle + (avr_cycle_count_t)(750 * CYCLES_MS - 10000) / (8 >> ((s->pad[4] >> 5) & 3));
    if (c == 0x4E) s->state = SETTINGS;
    if (c == 0xB4) s->state = STATUS;
    if (c == 0xBE) {
        s->pad[8] = crc8(s->pad, 8) ^ (s->fault == BAD_CRC ? 0x10 : 0);
        s->state = SENDING;
    }
}

// A slot is over: take the bit that the master wrote, or go on to the next that is sent.
static void slot(sensor_t *s, bool bit) {
    switch (s->state) {
        case ROM_COMMAND:
        case FUNCTION:
            s->byte = (s->byte >> 1) | (bit << 7);
            if (++s->bit == 8) command(s);
            break;
        case SEARCH:
            if (s->phase < 2) {
                s->phase++;
                break;
            }
            s->phase = 0;
            if (bit != ((s->rom[s->bit >> 3] >> (s->bit & 7)) & 1) || ++s->bit == 64) s->state = DEAF;
            break;
        case MATCH:
            if (bit != ((s->rom[s->bit >> 3] >> (s->bit & 7)) & 1)) s->state = DEAF;
            else if (++s->bit == 64) s->state = FUNCTION, s->bit = 0;
            break;
        case SETTINGS:
            s->byte = (s->byte >> 1) | (bit << 7);
            if ((++s->bit & 7) == 0) s->pad[1 + s->bit / 8] = s->bit == 24 ? (s->byte & 0x60) | 0x1F : s->byte;
            if (s->bit == 24) s->state = DEAF;
            break;
        case SENDING:
            s->bit++;
            break;
        default:
            break;
    }
}

static avr_cycle_count_t settle(avr_t *a, avr_cycle_count_t when, void *param) {
    (void)a, (void)when, (void)param;
    avr_cycle_count_t now = avr->cycle;
    bool slaves_low = now < low_until || (now >= presence_from && now < presence_until);
    avr_raise_irq(bus_pin, !(master_low || shorted || slaves_low));
    return 0;
}

// One timer for each edge: a later one of the same kind takes the place of the one before.
static avr_cycle_count_t settle_a(avr_t *a, avr_cycle_count_t w, void *p) { return settle(a, w, p); }
static avr_cycle_count_t settle_b(avr_t *a, avr_cycle_count_t w, void *p) { return settle(a, w, p); }

static void bus_driven(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)param;
    bool low = (value >> BUS) & 1;
    if (low == master_low) return;
    master_low = low;
    avr_cycle_count_t now = avr->cycle;
    if (low) {
        fell = now;
        for (int k = 0; k < count; k++) {
            if (!present(&sensors[k]) || shorted || sends(&sensors[k])) continue;
            low_until = now + avr_usec_to_cycles(avr, 30);
            avr_cycle_timer_register_usec(avr, 30, settle, NULL);
        }
    } else {
        uint32_t us = avr_cycles_to_usec(avr, now - fell);
        bool anybody = false;
        for (int k = 0; k < count; k++) {
            sensor_t *s = &sensors[k];
            if (!present(s)) continue;
            anybody = true;
            if (us < 440) {
                slot(s, us < 15);
                continue;
            }
            finish_conversion(s);
            s->state = ROM_COMMAND;
            s->bit = 0;
        }
        if (us >= 440 && anybody) {
            presence_from = now + avr_usec_to_cycles(avr, 30);
            presence_until = presence_from + avr_usec_to_cycles(avr, 120);
            avr_cycle_timer_register_usec(avr, 30, settle_a, NULL);
            avr_cycle_timer_register_usec(avr, 150, settle_b, NULL);
        }
    }
    settle(avr, now, NULL);
}

// ---- supply monitor -----------------------------------------------------------------------------------------------------------------

// Its current is that of a heater under PWM at half duty: what was not averaged has caught it on or off.
enum { INA_FRESH = 0x399F, INA_AVERAGES = 0x0078 };

static struct {
    bool there, selected;
    uint8_t pointer, index;
    uint16_t settings, millivolts;
    int16_t tenths;  // of a milliampere
    avr_irq_t *in;
} supply;

static void supply_asked(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)param;
    avr_twi_msg_irq_t v = {.u.v = value};
    if (v.u.twi.msg & TWI_COND_STOP) supply.selected = false;
    if (v.u.twi.msg & TWI_COND_START) {
        supply.selected = supply.there && (v.u.twi.addr & 0xFE) == 0x80;
        supply.index = 0;
        if (supply.selected) avr_raise_irq(supply.in, avr_twi_irq_msg(TWI_COND_ACK, v.u.twi.addr, 1));
    }
    if (!supply.selected) return;
    if (v.u.twi.msg & TWI_COND_WRITE) {
        if (!supply.index) supply.pointer = v.u.twi.data;
        else if (!supply.pointer) supply.settings = supply.index == 1 ? v.u.twi.data << 8 : supply.settings | v.u.twi.data;
        supply.index++;
        avr_raise_irq(supply.in, avr_twi_irq_msg(TWI_COND_ACK, v.u.twi.addr, 1));
    }
    if (v.u.twi.msg & TWI_COND_READ) {
        static bool on;
        int16_t current = (supply.settings & INA_AVERAGES) == INA_AVERAGES ? supply.tenths : (on = !on) ? 2 * supply.tenths : 0;
        uint16_t word = supply.pointer == 1 ? (uint16_t)current : supply.pointer == 2 ? (uint16_t)((supply.millivolts / 4) << 3) | 2 : supply.settings;
        uint8_t byte = supply.index++ ? word & 0xFF : word >> 8;
        avr_raise_irq(supply.in, avr_twi_irq_msg(TWI_COND_READ, v.u.twi.addr, byte));
    }
}

// ---- UART -----------------------------------------------------------------------------------------------------------------------------

static int master = -1, slave = -1;
static char out[256];
static size_t out_length;
static avr_irq_t *uart_in;
static bool uart_ready = true;

static void flush_line(void) {
    size_t done = 0;
    while (done < out_length) {
        ssize_t n = write(master, out + done, out_length - done);
        if (n > 0) {
            done += (size_t)n;
            continue;
        }
        // a simulated board can wait for a slow reader, so that a run faster than time loses nothing
        struct pollfd p = {.fd = master, .events = POLLOUT};
        if (poll(&p, 1, 20000) <= 0) break;
    }
    out_length = 0;
}

static void uart_sent(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)param;
    out[out_length++] = (char)value;
    if (value == '\n' || out_length == sizeof out) flush_line();
}

static void uart_xon(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)value, (void)param;
    uart_ready = true;
}

static void uart_xoff(struct avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq, (void)value, (void)param;
    uart_ready = false;
}

static avr_cycle_count_t uart_feed(avr_t *a, avr_cycle_count_t when, void *param) {
    (void)param;
    static uint8_t in[512];
    static ssize_t have, at;
    if (at == have) {
        have = read(master, in, sizeof in);
        at = 0;
        if (have <= 0) {
            have = 0;
            return when + CYCLES_MS;
        }
    }
    if (uart_ready) avr_raise_irq(uart_in, in[at++]);
    return when + avr_usec_to_cycles(a, 90);
}

static void open_terminal(void) {
    master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (master < 0 || grantpt(master) || unlockpt(master)) {
        perror("pseudo-terminal");
        exit(1);
    }
    // held open here too, so that a logger may come and go
    slave = open(ptsname(master), O_RDWR | O_NOCTTY);
    struct termios t;
    tcgetattr(slave, &t);
    cfmakeraw(&t);
    tcsetattr(slave, TCSANOW, &t);
    printf("pty %s\n", ptsname(master));
    fflush(stdout);
}

// ---- the driver on standard input and output ------------------------------------------------------------------------------------------

static double duty_sum[2];
static unsigned duty_count;

static double duty(int k) {
    if (!(avr->data[R_DDRB] & (2 << k)) || !(avr->data[R_TCCR1A] & (k ? 0x20 : 0x80))) return 0.0;
    unsigned top = avr->data[R_ICR1] | avr->data[R_ICR1 + 1] << 8;
    unsigned at = avr->data[R_OCR1 + 2 * k] | avr->data[R_OCR1 + 2 * k + 1] << 8;
    return top ? (at + 1.0) / (top + 1.0) : 0.0;
}

static avr_cycle_count_t sample_duty(avr_t *a, avr_cycle_count_t when, void *param) {
    (void)a, (void)param;
    for (int k = 0; k < 2; k++) duty_sum[k] += duty(k);
    duty_count++;
    return when + 10 * CYCLES_MS;
}

static bool restart_wanted;
static avr_cycle_count_t step, before_reset, seen;  // a reset sets the simulator's cycles back to zero

static avr_cycle_count_t step_done(avr_t *a, avr_cycle_count_t when, void *param);

static void begin_timers(void) {
    avr_cycle_timer_register(avr, CYCLES_MS, uart_feed, NULL);
    avr_cycle_timer_register(avr, 5 * CYCLES_MS, sample_duty, NULL);
    avr_cycle_timer_register(avr, step - (before_reset + avr->cycle) % step, step_done, NULL);
}

// A reset, by the button here or by the firmware's own watchdog, forgets every timer of the simulator and begins its cycles anew: that they
// go back is its sign. An overdue timer looks as one that was forgotten, and a step too many warms what the sensors feel.
static void look_for_reset(void) {
    if (restart_wanted) {
        restart_wanted = false;
        avr_reset(avr);
        avr->data[R_MCUSR] |= 2;
    }
    before_reset += seen - avr->cycle;
    seen = avr->cycle;
    begin_timers();
    uart_ready = true;
    master_low = false;
    low_until = presence_from = presence_until = 0;
    for (int k = 0; k < count; k++) sensors[k].converted = sensors[k].converted ? 1 : 0;
    avr_raise_irq(bus_pin, 0);  // a level that is not new would not reach the pin, which the reset has emptied
    settle(avr, avr->cycle, NULL);
}

// One line of the driver; false at `go`.
static bool obey(char *text) {
    int k, a, b;
    char word[16];
    if (!strncmp(text, "go", 2)) return false;
    if (!strncmp(text, "quit", 4)) exit(0);
    if (!strncmp(text, "reset", 5)) restart_wanted = true;
    else if (sscanf(text, "short %d", &k) == 1) {
        shorted = k;
        settle(avr, avr->cycle, NULL);
    } else if (sscanf(text, "supply %d %d", &a, &b) == 2) {
        if (!a) supply.settings = INA_FRESH;  // without supply it forgets
        supply.millivolts = a;
        supply.tenths = b;
    } else if (sscanf(text, "t %d %d", &k, &a) == 2 && k >= 0 && k < count) sensors[k].raw = a;
    else if (sscanf(text, "fault %d %15s", &k, word) == 2 && k >= 0 && k < count) {
        static const char *const names[] = {"good", "crc", "lost", "power", "parasite"};
        for (int f = 0; f < 5; f++) {
            if (strcmp(word, names[f])) continue;
            if (sensors[k].fault == LOST && f != LOST) power_up(&sensors[k]);
            sensors[k].fault = (fault_t)f;
        }
    } else fprintf(stderr, "not understood: %s", text);
    return true;
}

static avr_cycle_count_t step_done(avr_t *a, avr_cycle_count_t when, void *param) {
    (void)a, (void)param;
    unsigned n = duty_count ? duty_count : 1;
    printf("at %llu %.4f %.4f\n", (unsigned long long)((before_reset + when) / CYCLES_MS), duty_sum[0] / n, duty_sum[1] / n);
    fflush(stdout);
    duty_sum[0] = duty_sum[1] = duty_count = 0;
    char text[128];
    do {
        if (!fgets(text, sizeof text, stdin)) exit(0);
    } while (obey(text));
    return when + step;
}

static void no_pause(avr_t *a, avr_cycle_count_t cycles) { (void)a, (void)cycles; }

static void no_log(avr_t *a, const int level, const char *format, va_list ap) {
    (void)a;
    if (level <= LOG_ERROR) vfprintf(stderr, format, ap);
}

int main(int argc, char **argv) {
    int step_ms = 1000;
    const char *elf = NULL;
    for (int k = 1; k < argc; k++) {
        if (!strcmp(argv[k], "--sensors") && k + 1 < argc) count = atoi(argv[++k]);
        else if (!strcmp(argv[k], "--step") && k + 1 < argc) step_ms = atoi(argv[++k]);
        else if (!strcmp(argv[k], "--supply")) supply.there = true, supply.settings = INA_FRESH;
        else if (!strcmp(argv[k], "--parasite")) parasite_seen = true;
        else elf = argv[k];
    }
    if (!elf || count < 0 || count > MOST || step_ms < 1) {
        fprintf(stderr, "bench [--sensors N] [--step MS] [--supply] [--parasite] FIRMWARE.elf\n");
        return 2;
    }
    avr_global_logger_set(no_log);
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (elf_read_firmware(elf, &firmware)) {
        fprintf(stderr, "%s: no firmware; `make firmware` builds it\n", elf);
        return 1;
    }
    firmware.frequency = 16000000;
    avr = avr_make_mcu_by_name("atmega328p");
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    avr->sleep = no_pause;
    avr->data[R_MCUSR] |= 1;

    for (int k = 0; k < count; k++) {
        uint64_t serial = 0x0F1A0B3C0000ull + (unsigned)k;
        sensors[k].rom[0] = 0x28;
        for (int b = 0; b < 6; b++) sensors[k].rom[1 + b] = (serial >> (8 * b)) & 0xFF;
        sensors[k].rom[7] = crc8(sensors[k].rom, 7);
        sensors[k].raw = 320;
        power_up(&sensors[k]);
    }
    if (parasite_seen && count) sensors[0].fault = PARASITE;
    bus_pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), BUS);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), IOPORT_IRQ_DIRECTION_ALL), bus_driven, NULL);
    settle(avr, 0, NULL);

    supply.in = avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), TWI_IRQ_OUTPUT), supply_asked, NULL);

    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    open_terminal();
    uart_in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), uart_sent, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), uart_xon, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), uart_xoff, NULL);

    step = (avr_cycle_count_t)step_ms * CYCLES_MS;
    begin_timers();
    for (;;) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the firmware ended\n");
            return 1;
        }
        if (restart_wanted || avr->cycle < seen) look_for_reset();
        seen = avr->cycle;
    }
}
