// Runs a .hex for the ATmega328P on libsimavr, with its UART behind a pseudo-terminal.
//
//     host [--boot SECONDS] [--lost ADDRESS] [--refused ADDRESS] [--fast] FIRMWARE.hex
//
// As with an Uno, opening the port resets the board, and for the boot time it is deaf and its pins
// are idle. It prints one line of JSON with the port, answers each line of its standard input that
// asks something with a line of JSON, and ends with its standard input:
//
//     state         what the board is doing
//     reset         press the reset button
//     power         switch off and on: the memory forgets, and no boot loader waits
//     line HEX      put bytes on the line, as if they had come through the port
//     break         put a byte with a framing error on the line
//     vanish        close the port, as if the cable was pulled
//     run SECONDS   with --fast, where there is no port and time only passes so: the same as
//                   state, then, and what the board said meanwhile
//
// --lost and --refused name two 16-bit counters in the memory of the firmware.
//
// simavr 1.6 has four faults with time: it counts a parity bit always, it works the byte time out
// only when the divisor is written, it does not wait for the wall clock while code runs, and while
// code sleeps it jumps to the next event. `mend_uart`, `keep_alive`, `no_sleep` and the pace in
// `serve` are against these.

#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <pty.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "avr_uart.h"
#include "pins.h"
#include "sim_avr.h"
#include "sim_hex.h"

#define BYTE_CYCLES (HZ * 10 / 115200)
#define SLICE (HZ / 2000)  // 0.5 ms
#define IN_HAND 64         // bytes read ahead from the port; the rest waits in the kernel

typedef struct {
    char *data;
    size_t length, size;
} Bytes;

avr_t *avr;
static avr_uart_t *uart;

static double boot_s = 1.0;
static uint16_t lost_at, refused_at;
static unsigned long resets, lost_before, refused_before;

static avr_cycle_count_t boots_until;
static Bytes line, said;
static size_t line_next;  // of `line`, the first that is not delivered
static double line_free;  // when the last of it has been sent
static size_t damaged = SIZE_MAX;  // of `line`, the byte with a framing error
static int master = -1;
static bool opened;

static void append(Bytes *bytes, const void *data, size_t length) {
    if (bytes->length + length > bytes->size) {
        bytes->size = 2 * (bytes->length + length);
        bytes->data = realloc(bytes->data, bytes->size);
    }
    memcpy(bytes->data + bytes->length, data, length);
    bytes->length += length;
}

static size_t on_line(void) { return line.length - line_next; }

// The line ----------------------------------------------------------------------------------------

static void empty_line(void) {
    line.length = line_next = 0;
    damaged = SIZE_MAX;
}

// When the first byte on the line has been sent; the last ends at line_free.
static double arrival(void) { return line_free - (on_line() - 1) * BYTE_CYCLES; }

static void mend_uart(void) {
    unsigned divisor = avr->data[0xc4] | (avr->data[0xc5] & 0xf) << 8;
    unsigned bit = (divisor + 1) * (avr->data[0xc0] & 2 ? 8 : 16);
    uart->cycles_per_byte = bit * 10;
}

// simavr gives a byte to the firmware a byte time of its own after this.
static double start(void) { return arrival() - uart->cycles_per_byte; }

static avr_cycle_count_t deliver(avr_t *avr, avr_cycle_count_t when, void *unused) {
    (void)when, (void)unused;
    mend_uart();
    uint32_t byte = (uint8_t)line.data[line_next];
    if (line_next++ == damaged) byte |= UART_INPUT_FE;
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT), byte);
    if (on_line()) return (avr_cycle_count_t)start();
    empty_line();
    return 0;
}

static void watch_line(void) {
    mend_uart();
    double in = start() - avr->cycle;
    avr_cycle_timer_register(avr, in > 1 ? in : 1, deliver, NULL);
}

// Bytes on the line that nobody hears.
static void swallow(void) {
    while (on_line() && arrival() <= avr->cycle) {
        line_next++;
        lost_before++;
    }
    if (!on_line()) empty_line();
}

static void put(const void *data, size_t length) {
    if (!length) return;
    bool idle = !on_line();
    if (idle && line_free < avr->cycle) line_free = avr->cycle;
    append(&line, data, length);
    line_free += length * BYTE_CYCLES;
    if (idle && avr->cycle >= boots_until) watch_line();
}

static void hear(avr_irq_t *irq, uint32_t value, void *unused) {
    (void)irq, (void)unused;
    mend_uart();
    char byte = value;
    append(&said, &byte, 1);
}

// The chip ----------------------------------------------------------------------------------------

static avr_cycle_count_t keep_alive(avr_t *avr, avr_cycle_count_t when, void *unused) {
    (void)avr, (void)unused;
    return when + SLICE;
}

static void no_sleep(avr_t *avr, avr_cycle_count_t how_long) { (void)avr, (void)how_long; }

static unsigned counter(uint16_t at) { return at ? avr->data[at] | avr->data[at + 1] << 8 : 0; }

// So that what the memory holds before code clears it is not taken for a count.
static void clear_counters(void) {
    if (lost_at) memset(avr->data + lost_at, 0, 2);
    if (refused_at) memset(avr->data + refused_at, 0, 2);
}

static void start_code(void) {
    uint32_t no_flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &no_flags);
    avr_cycle_timer_register(avr, SLICE, keep_alive, NULL);
    if (on_line()) watch_line();
}

static void reset(double boot) {
    lost_before += counter(lost_at);
    refused_before += counter(refused_at);
    empty_line();
    line_free = avr->cycle;
    pins_idle();
    avr_reset(avr);
    // What the boot loaders of Uno and old Nano use: their variables below, their stack above.
    memset(avr->data + 0x100, 0xb0, 0x200);
    memset(avr->data + 0x880, 0xb0, 0x80);
    clear_counters();
    boots_until = avr->cycle + (avr_cycle_count_t)(boot * HZ);
    if (boot <= 0) start_code();
}

static void power(void) {
    unsigned seed = 1;
    reset(0);
    for (int at = 0x100; at < 0x900; at++) avr->data[at] = rand_r(&seed);
    clear_counters();
}

// Until a cycle, or a little later.
static void run(avr_cycle_count_t until) {
    if (avr->cycle < boots_until) {
        avr->cycle = until < boots_until ? until : boots_until;
        swallow();
        if (avr->cycle < boots_until) return;
        start_code();
    }
    while (avr->cycle < until) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the firmware ended at %#x\n", avr->pc);
            exit(1);
        }
    }
}

static void load(const char *path) {
    ihex_chunk_p chunks;
    int count = read_ihex_chunks(path, &chunks);
    if (count <= 0) {
        fprintf(stderr, "%s is no firmware\n", path);
        exit(1);
    }
    avr = avr_make_mcu_by_name("atmega328p");
    avr_init(avr);
    avr->frequency = HZ;
    avr->sleep = no_sleep;
    avr->log = LOG_ERROR;
    for (int i = 0; i < count; i++) {
        avr_loadcode(avr, chunks[i].data, chunks[i].size, chunks[i].baseaddr);
    }
    for (avr_io_t *io = avr->io_port; io; io = io->next) {
        if (!strcmp(io->kind, "uart")) uart = (avr_uart_t *)io;
    }
    avr_irq_register_notify(
        avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), hear, NULL);
    pins_watch();
}

// What is asked -----------------------------------------------------------------------------------

static void report(bool with_said) {
    printf("{\"time\": %.6f, \"opened\": %s, \"resets\": %lu, \"lost\": %lu, \"refused\": %lu, "
           "\"servos\": [",
           avr->cycle / HZ, opened ? "true" : "false", resets, lost_before + counter(lost_at),
           refused_before + counter(refused_at));
    pins_report();
    printf("]");
    if (with_said) {
        printf(", \"said\": \"");
        for (size_t i = 0; i < said.length; i++) printf("%02x", (uint8_t)said.data[i]);
        printf("\"");
        said.length = 0;
    }
    printf("}\n");
    fflush(stdout);
}

static void put_hex(const char *hex) {
    for (unsigned byte; sscanf(hex, "%2x", &byte) == 1; hex += 2) {
        char data = byte;
        put(&data, 1);
    }
}

static void answer(char *words) {
    char *rest = strchr(words, ' ');
    if (rest) *rest++ = 0;
    if (!strcmp(words, "state")) {
        report(false);
    } else if (!strcmp(words, "run") && rest) {
        run(avr->cycle + (avr_cycle_count_t)(atof(rest) * HZ));
        report(true);
    } else if (!strcmp(words, "line") && rest) {
        put_hex(rest);
    } else if (!strcmp(words, "break")) {
        damaged = line.length;
        put("x", 1);
    } else if (!strcmp(words, "reset")) {
        resets++;
        reset(boot_s);
    } else if (!strcmp(words, "power")) {
        power();
    } else if (!strcmp(words, "vanish")) {
        if (master >= 0) close(master);
        master = -1;
    } else {
        fprintf(stderr, "cannot %s\n", words);
        exit(1);
    }
}

// The port ----------------------------------------------------------------------------------------

static void open_port(void) {
    int slave;
    char name[64];
    struct termios raw = {0};
    cfmakeraw(&raw);
    if (openpty(&master, &slave, name, &raw, NULL)) {
        perror("openpty");
        exit(1);
    }
    fcntl(master, F_SETFL, O_NONBLOCK);
    close(slave);  // only while no slave is open does the master tell that a client came or went
    printf("{\"port\": \"%s\"}\n", name);
    fflush(stdout);
}

static void look_at_port(void) {
    char data[IN_HAND];
    if (master < 0) return;
    struct pollfd port = {.fd = master, .events = POLLIN};
    poll(&port, 1, 0);
    bool gone = port.revents & POLLHUP;
    if (opened == gone) {
        opened = !gone;
        if (opened) {
            resets++;
            reset(boot_s);
            said.length = 0;  // what came before nobody heard
        }
    }
    ssize_t length = 1;
    while (length > 0 && (gone || on_line() < IN_HAND)) {
        length = read(master, data, gone ? IN_HAND : IN_HAND - on_line());
        if (length > 0 && !gone) put(data, length);  // of one that went nothing is for the next
    }
    if (said.length && opened && write(master, said.data, said.length) < 0 && errno != EAGAIN) {
        perror("write");
    }
    said.length = 0;
}

// False at its end.
static bool look_at_input(void) {
    static Bytes asked;
    char data[4096];
    ssize_t length = read(STDIN_FILENO, data, sizeof data);
    if (length == 0 || (length < 0 && errno != EAGAIN)) return false;
    if (length > 0) append(&asked, data, length);
    char *end;
    while (asked.length && (end = memchr(asked.data, '\n', asked.length))) {
        *end++ = 0;
        answer(asked.data);
        asked.length -= end - asked.data;
        memmove(asked.data, end, asked.length);
    }
    return true;
}

// In real time, a slice at a time.
static void serve(void) {
    fcntl(STDIN_FILENO, F_SETFL, fcntl(STDIN_FILENO, F_GETFL) | O_NONBLOCK);
    open_port();
    struct timespec began, wake;
    clock_gettime(CLOCK_MONOTONIC, &began);
    avr_cycle_count_t zero = avr->cycle;
    for (uint64_t slice = 1; look_at_input(); slice++) {
        uint64_t ns = began.tv_nsec + slice * 500000;
        wake.tv_sec = began.tv_sec + ns / 1000000000;
        wake.tv_nsec = ns % 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, NULL);
        run(zero + (avr_cycle_count_t)(slice * SLICE));
        look_at_port();
    }
}

int main(int count, char **words) {
    static const struct option options[] = {
        {"boot", required_argument, NULL, 'b'},
        {"lost", required_argument, NULL, 'l'},
        {"refused", required_argument, NULL, 'r'},
        {"fast", no_argument, NULL, 'f'},
        {0},
    };
    bool fast = false;
    for (int option; (option = getopt_long(count, words, "", options, NULL)) != -1;) {
        if (option == 'b') boot_s = atof(optarg);
        else if (option == 'l') lost_at = strtoul(optarg, NULL, 0);
        else if (option == 'r') refused_at = strtoul(optarg, NULL, 0);
        else if (option == 'f') fast = true;
        else return 2;
    }
    if (optind != count - 1) return 2;
    load(words[optind]);
    power();
    lost_before = refused_before = 0;
    if (fast) {
        while (look_at_input()) {
        }
    } else {
        serve();
    }
    return 0;
}
