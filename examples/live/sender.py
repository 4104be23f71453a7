"""A rig in few lines: sends a setup and frames as a stream (docs/reference/stream-format.md).

    python examples/live/sender.py 500 | python -m reconstruction live -
    python examples/live/sender.py 500 localhost 5800

Nothing but Python's own library, and none of it that MicroPython lacks: a rig puts its readings in
place of `counts` and `TAPS`. `sender.c` sends the same bytes.
"""

import binascii
import struct
import sys

MAGIC, VERSION = b"SPI\x1a", 1
SETUP, FRAME, END = 1, 2, 3
SIDE = 8
PIXELS = SIDE * SIDE
EXPOSURES = 2 * PIXELS
PERIOD_NS = 8_533_333
DARK = 100
TAPS = (
    *(2669, 2744, 1331, 1256),
    *(2308, 2951, 1692, 1049),
    *(1894, 2994, 2106, 1006),
    *(1499, 2865, 2501, 1135),
)
"""Four of each spot, at 2, 3, 4 and 5 m."""
ACROSS, AHEAD = 0.04987546680538165, 0.997509336107633
QUARTER = 1.5707963267948966


def message(kind, payload, number, time_ns, setup):
    """A message of any kind, with both checksums."""
    head = struct.pack("<4sBBHIIQI", MAGIC, VERSION, kind, 1, number, len(payload), time_ns, setup)
    return (
        head
        + struct.pack("<I", binascii.crc32(head))
        + payload
        + struct.pack("<I", binascii.crc32(payload))
    )


def entry(name, kind, shape, content):
    """An array of a setup: name, type, shape, numbers."""
    return (
        struct.pack("<B", len(name))
        + name.encode()
        + struct.pack("<2sB", kind.encode(), len(shape))
        + struct.pack(f"<{len(shape)}I", *shape)
        + content
    )


def text(name, value):
    """A text of a setup."""
    return entry(name, "t1", (len(value),), value.encode())


def numbers(name, *values, shape=()):
    """Numbers of a setup, as float64: one, or an array."""
    return entry(name, "f8", shape, struct.pack(f"<{len(values)}d", *values))


def setup():
    """What all frames have in common; arrays of 0 frames tell what a frame consists of."""
    index = [k for k in range(PIXELS) for _ in range(2)]
    directions = [(x, y, AHEAD) for y in (-ACROSS, ACROSS) for x in (-ACROSS, ACROSS)]
    return b"".join(
        (
            text("source", "hardware"),
            text("software", "sender 1.0"),
            entry("patterns/shape", "u2", (2,), struct.pack("<2H", SIDE, SIDE)),
            entry("patterns/index", "u2", (EXPOSURES,), struct.pack(f"<{EXPOSURES}H", *index)),
            entry("patterns/polarity", "i1", (EXPOSURES,), struct.pack("<2b", 1, -1) * PIXELS),
            text("patterns/basis", "hadamard"),
            text("patterns/order", "natural"),
            entry("buckets/counts", "u2", (0, EXPOSURES), b""),
            numbers("buckets/exposure_time_s", 6e-5),
            numbers("buckets/pattern_period_s", 6.666666666666667e-05),
            numbers("buckets/electrons_per_count", 1000.0),
            numbers("buckets/offset_counts", DARK),
            numbers("buckets/noise_electrons", 3000.0),
            numbers("buckets/excess_noise_factor", 1.0),
            numbers("buckets/dead_time_s", 0.0),
            numbers("buckets/baseline_electrons", 0.0),
            text("spots/method", "cw"),
            entry("spots/taps", "u2", (0, 4, 4), b""),
            numbers("spots/electrons_per_count", 100.0),
            numbers("spots/offset_counts", 0.0),
            numbers("spots/noise_electrons", 100.0),
            numbers("spots/excess_noise_factor", 1.0),
            numbers("spots/directions", *(v for each in directions for v in each), shape=(4, 3)),
            numbers("spots/detector_positions_m", *[0.0] * 12, shape=(4, 3)),
            numbers("spots/tap_frequencies_hz", *[1e7] * 4, shape=(4,)),
            numbers("spots/tap_phases_rad", *(k * QUARTER for k in range(4)), shape=(4,)),
            numbers("spots/phase_offsets_rad", *[0.0] * 4, shape=(4,)),
            numbers("spots/periods", 600.0),
            numbers("optics/tan_half_width", 0.1),
            numbers("optics/tan_half_height", 0.1),
        )
    )


def light(pixel, frame):
    """Counts that a pixel adds: a slope, and a square that wanders."""
    row, column = divmod(pixel, SIDE)
    bright = 2 <= row < 6 and (column - frame // 16) % SIDE < 3
    return 20 + 5 * column + (120 if bright else 0)


def counts(frame):
    """Readings of a frame: each pattern, then its complement."""
    image = [light(pixel, frame) for pixel in range(PIXELS)]
    readings = []
    for k in range(PIXELS):
        displayed = sum(image[u] for u in range(PIXELS) if bin(k & u).count("1") % 2 == 0)
        readings += [DARK + displayed, DARK + sum(image) - displayed]
    return readings


def stream(frames):
    """All messages."""
    announced = setup()
    mine = binascii.crc32(announced)
    for frame in range(frames):
        time_ns = frame * PERIOD_NS
        if frame % 128 == 0:  # once a second, for those who came later
            yield message(SETUP, announced, frame, time_ns, mine)
        payload = struct.pack(f"<{EXPOSURES}H16H", *counts(frame), *TAPS)
        yield message(FRAME, payload, frame, time_ns, mine)
    yield message(END, b"", frames, frames * PERIOD_NS, mine)


def main():
    """Send so many frames to standard output, or to a host and port."""
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    if len(sys.argv) > 3:
        import socket

        with socket.create_connection((sys.argv[2], int(sys.argv[3]))) as connected:
            for each in stream(frames):
                connected.sendall(each)
        return
    for each in stream(frames):
        sys.stdout.buffer.write(each)


if __name__ == "__main__":
    main()
