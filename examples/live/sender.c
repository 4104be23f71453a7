/* A rig in few lines: sends a setup and frames as a stream (docs/reference/stream-format.md).
 *
 *     cc -std=c99 -O2 -o sender examples/live/sender.c
 *     ./sender 500 | python -m reconstruction live -
 *
 * No heap, no floating-point arithmetic, 2 KiB of static memory. Firmware puts its port in place of
 * `transmit`, its readings in place of `counts_of` and `TAPS`, and its clock in place of the frame's
 * number. `sender.py` sends the same bytes. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { SETUP = 1, FRAME = 2, END = 3 };
enum { SIDE = 8, PIXELS = SIDE * SIDE, EXPOSURES = 2 * PIXELS, DARK = 100 };
#define PERIOD_NS 8533333u

/* Four of each spot, at 2, 3, 4 and 5 m. */
static const uint16_t TAPS[16] = {2669, 2744, 1331, 1256, 2308, 2951, 1692, 1049,
                                  1894, 2994, 2106, 1006, 1499, 2865, 2501, 1135};
static const double ACROSS = 0.04987546680538165, AHEAD = 0.997509336107633;
static const double QUARTERS[4] = {0.0, 1.5707963267948966, 3.141592653589793, 4.71238898038469};

static uint8_t payload[2048];
static size_t used;

static void transmit(const uint8_t *bytes, size_t count) {
    fwrite(bytes, 1, count, stdout);
}

/* CRC-32 of zlib, four bits at a time: polynomial 0xEDB88320, begun and ended with all ones. */
static uint32_t crc32_of(const uint8_t *bytes, size_t count) {
    static const uint32_t table[16] = {
        0x00000000, 0x1DB71064, 0x3B6E20C8, 0x26D930AC, 0x76DC4190, 0x6B6B51F4,
        0x4DB26158, 0x5005713C, 0xEDB88320, 0xF00F9344, 0xD6D6A3E8, 0xCB61B38C,
        0x9B64C2B0, 0x86D3D2D4, 0xA00AE278, 0xBDBDF21C};
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < count; i++) {
        crc = table[(crc ^ bytes[i]) & 15] ^ (crc >> 4);
        crc = table[(crc ^ (uint32_t)(bytes[i] >> 4)) & 15] ^ (crc >> 4);
    }
    return ~crc;
}

/* Little endian, whatever the machine is. */
static size_t put(uint8_t *at, uint64_t value, size_t bytes) {
    for (size_t i = 0; i < bytes; i++) at[i] = (uint8_t)(value >> (8 * i));
    return bytes;
}

static void add(uint64_t value, size_t bytes) { used += put(payload + used, value, bytes); }

static void add_text(const char *text) {
    size_t count = strlen(text);
    memcpy(payload + used, text, count);
    used += count;
}

static void add_double(double value) {
    uint64_t bits;
    memcpy(&bits, &value, 8);
    add(bits, 8);
}

/* Name, type and shape of an entry, whose numbers follow. */
static void entry(const char *name, const char *type, unsigned axes, unsigned first,
                  unsigned second, unsigned third) {
    const unsigned shape[3] = {first, second, third};
    add(strlen(name), 1);
    add_text(name);
    add_text(type);
    add(axes, 1);
    for (unsigned i = 0; i < axes; i++) add(shape[i], 4);
}

static void text(const char *name, const char *value) {
    entry(name, "t1", 1, (unsigned)strlen(value), 0, 0);
    add_text(value);
}

static void number(const char *name, double value) {
    entry(name, "f8", 0, 0, 0, 0);
    add_double(value);
}

static void four(const char *name, const double *values) {
    entry(name, "f8", 1, 4, 0, 0);
    for (int i = 0; i < 4; i++) add_double(values[i]);
}

/* What all frames have in common; arrays of 0 frames tell what a frame consists of. */
static void set_up(void) {
    static const double frequencies[4] = {1e7, 1e7, 1e7, 1e7}, zeros[4] = {0};
    used = 0;
    text("source", "hardware");
    text("software", "sender 1.0");
    entry("patterns/shape", "u2", 1, 2, 0, 0);
    add(SIDE, 2);
    add(SIDE, 2);
    entry("patterns/index", "u2", 1, EXPOSURES, 0, 0);
    for (unsigned i = 0; i < EXPOSURES; i++) add(i / 2, 2);
    entry("patterns/polarity", "i1", 1, EXPOSURES, 0, 0);
    for (unsigned i = 0; i < EXPOSURES; i++) add(i % 2 ? 0xFF : 1, 1);
    text("patterns/basis", "hadamard");
    text("patterns/order", "natural");
    entry("buckets/counts", "u2", 2, 0, EXPOSURES, 0);
    number("buckets/exposure_time_s", 6e-5);
    number("buckets/pattern_period_s", 6.666666666666667e-05);
    number("buckets/electrons_per_count", 1000.0);
    number("buckets/offset_counts", DARK);
    number("buckets/noise_electrons", 3000.0);
    number("buckets/excess_noise_factor", 1.0);
    number("buckets/dead_time_s", 0.0);
    number("buckets/baseline_electrons", 0.0);
    text("spots/method", "cw");
    entry("spots/taps", "u2", 3, 0, 4, 4);
    number("spots/electrons_per_count", 100.0);
    number("spots/offset_counts", 0.0);
    number("spots/noise_electrons", 100.0);
    number("spots/excess_noise_factor", 1.0);
    entry("spots/directions", "f8", 2, 4, 3, 0);
    for (int i = 0; i < 4; i++) {
        add_double(i % 2 ? ACROSS : -ACROSS);
        add_double(i / 2 ? ACROSS : -ACROSS);
        add_double(AHEAD);
    }
    entry("spots/detector_positions_m", "f8", 2, 4, 3, 0);
    for (int i = 0; i < 12; i++) add_double(0.0);
    four("spots/tap_frequencies_hz", frequencies);
    four("spots/tap_phases_rad", QUARTERS);
    four("spots/phase_offsets_rad", zeros);
    number("spots/periods", 600.0);
    number("optics/tan_half_width", 0.1);
    number("optics/tan_half_height", 0.1);
}

/* Sends `payload` as a message of any kind, with both checksums. */
static void message(uint8_t kind, uint32_t frame, uint64_t time_ns, uint32_t setup) {
    uint8_t head[32], crc[4];
    memcpy(head, "SPI\x1a", 4);
    head[4] = 1; /* version */
    head[5] = kind;
    put(head + 6, 1, 2); /* run: a number that is another after each start, such as a counter */
    put(head + 8, frame, 4);
    put(head + 12, used, 4);
    put(head + 16, time_ns, 8);
    put(head + 24, setup, 4);
    put(head + 28, crc32_of(head, 28), 4);
    put(crc, crc32_of(payload, used), 4);
    transmit(head, 32);
    transmit(payload, used);
    transmit(crc, 4);
}

/* Counts that a pixel adds: a slope, and a square that wanders. */
static unsigned light(unsigned pixel, uint32_t frame) {
    unsigned row = pixel / SIDE, column = pixel % SIDE;
    int bright = row >= 2 && row < 6 && (column + SIDE - frame / 16 % SIDE) % SIDE < 3;
    return 20 + 5 * column + (bright ? 120 : 0);
}

static int odd(unsigned bits) {
    for (unsigned half = 16; half; half /= 2) bits ^= bits >> half;
    return (int)(bits & 1);
}

/* Readings of a frame: each pattern, then its complement. */
static void counts_of(uint32_t frame) {
    for (unsigned k = 0; k < PIXELS; k++) {
        unsigned shown = DARK, hidden = DARK;
        for (unsigned u = 0; u < PIXELS; u++)
            *(odd(k & u) ? &hidden : &shown) += light(u, frame);
        add(shown, 2);
        add(hidden, 2);
    }
}

int main(int argc, char **argv) {
    uint32_t frames = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 1000, setup, frame;
    set_up();
    setup = crc32_of(payload, used);
    for (frame = 0; frame < frames; frame++) {
        uint64_t time_ns = (uint64_t)frame * PERIOD_NS;
        if (frame % 128 == 0) { /* once a second, for those who came later */
            set_up();
            message(SETUP, frame, time_ns, setup);
        }
        used = 0;
        counts_of(frame);
        for (int i = 0; i < 16; i++) add(TAPS[i], 2);
        message(FRAME, frame, time_ns, setup);
    }
    used = 0;
    message(END, frames, (uint64_t)frames * PERIOD_NS, setup);
    return 0;
}
