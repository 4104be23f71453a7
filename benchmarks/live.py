"""A live stream: frames at the rate of the rig, and a link that loses, spoils and mixes them up.

    python benchmarks/live.py [--quick] [--json] [--markdown]

64 × 64 pixels, 128 exposures a frame at 15 kHz, 117 frames a second, from counts to image, ranges
and depth with the default methods. A process of its own sends simulated frames of the warehouse by
TCP, on the same machine; its first frame leaves a few seconds after the setup, while which the
methods are compiled. Then the same with one frame in a hundred corrupted in any one byte, one lost
and one swapped with the next. Every result is compared with that of the same frame reconstructed
from memory. `--markdown` pastes the tables into docs/results/live.md.
"""

import hashlib
import multiprocessing
import socket
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from intervals import of_quantile
from options import benchmark_options, finish
from threadpoolctl import threadpool_limits
from yardstick import Yardstick

import spisim
from reconstruction import Capture, Reconstructor, Result
from spisim_live import Counts, Loop, Outcome, Reception, Sender, frame_period_s
from spisim_live.links.sockets import TcpListen
from spisim_live.loop import fast_depth
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "live.md"
SECONDS, QUICK_S = 60, 10
DIFFERENT = 32
"""Frames that differ, sent over and over."""
FRACTION = 0.01
"""Of the frames, for each kind of fault."""
HEAD_START_S = 4.0
MAX_LATENCY_MS = 25.0


@dataclass(frozen=True)
class Faults:
    """Numbers of frames that are to be spoilt; a swapped one changes places with the next."""

    corrupted: frozenset[int] = frozenset()
    lost: frozenset[int] = frozenset()
    swapped: frozenset[int] = frozenset()


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a stream: digests of the results by number, counts, latencies in ms.

    ``processor_ms`` is the time that the thread with the results took for each, however busy the
    machine was with other things.
    """

    digests: dict[int, str]
    counts: Counts
    latencies_ms: np.ndarray
    processor_ms: np.ndarray


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, f"{QUICK_S} s each", PAGE)
    capture = spisim.simulate(
        spisim.load_scene("warehouse"), spisim.load_instrument("paper"), spp=16, frames=DIFFERENT
    ).capture
    frames = round((QUICK_S if options.quick else SECONDS) / frame_period_s(capture.setup))
    reconstruct = Reconstructor(capture.setup, depth=fast_depth(capture.setup))
    expected = [digest(reconstruct(capture.frame(n))) for n in range(DIFFERENT)]
    faults = drawn(frames, np.random.default_rng(0))
    yardstick = Yardstick()
    yardstick.look()
    clean = run(capture, frames, Faults())
    yardstick.look()
    outliers = run(capture, frames, faults)
    yardstick.look()
    latency_ms, latency_interval = yardstick.on_reference(
        percentile(clean.latencies_ms, 99), of_quantile(clean.latencies_ms, 0.99)
    )
    lost, gone = frames - len(clean.digests), missing(outliers, frames, faults)
    rows = [row("clean", clean, expected), row("with faults", outliers, expected)]
    checks = [
        Check("clean: frames without a result", lost, 0, interval=yardstick.of_lateness(lost)),
        Check("clean: wrong results", wrong(clean, expected), 0),
        Check(
            "clean: latency, 99 %, ms on the reference",
            latency_ms,
            MAX_LATENCY_MS,
            interval=yardstick.of_lateness(latency_ms) or latency_interval,
        ),
        *detected(outliers, faults),
        Check(
            "faults: sound frames without a result", gone, 0, interval=yardstick.of_lateness(gone)
        ),
        Check("faults: wrong results", wrong(outliers, expected), 0),
    ]
    columns = (
        *("link", "frames", "results", "wrong", "latency, median, ms", "99 %, ms", "most, ms"),
        *("processor time of a frame, median, ms", "99 %, ms"),
    )
    title = f"{frames} frames at {1 / frame_period_s(capture.setup):.1f} a second:"
    around = surroundings(("spisim", "numpy", "scipy", "numba"))
    return finish(options, PAGE, "benchmark", around, [Table(title, columns, rows)], checks)


def row(name: str, run: Run, expected: list[str]) -> tuple[str, ...]:
    """Cells of a table."""
    figures = [percentile(run.latencies_ms, fraction) for fraction in (50, 99, 100)]
    figures += [percentile(run.processor_ms, fraction) for fraction in (50, 99)]
    numbers = (run.counts.received, len(run.digests), wrong(run, expected))
    return (name, *map(str, numbers), *(f"{each:.1f}" for each in figures))


def detected(run: Run, faults: Faults) -> list[Check]:
    """Reported faults beside the actual ones.

    One in the header of a message is a frame lost and bytes discarded.
    """
    counts = run.counts
    gone = len(faults.lost) + len(faults.corrupted)
    return [
        Check(
            "faults: corrupted or lost, not counted", abs(counts.lost + counts.corrupted - gone), 0
        ),
        Check("faults: lost, not counted as lost", max(len(faults.lost) - counts.lost, 0), 0),
        Check("faults: reordered, not counted", abs(counts.reordered - len(faults.swapped)), 0),
        Check("faults: counted as late or duplicated", counts.late + counts.duplicated, 0),
    ]


def missing(run: Run, frames: int, faults: Faults) -> int:
    """Frames that came whole and have no result."""
    return len(set(range(frames)) - faults.corrupted - faults.lost - set(run.digests))


def wrong(run: Run, expected: list[str]) -> int:
    """Results other than those of the same frames from memory, in any bit."""
    return sum(each != expected[number % DIFFERENT] for number, each in run.digests.items())


def percentile(values: np.ndarray, fraction: float) -> float:
    """What so many per cent stay below."""
    return float(np.percentile(values, fraction)) if values.size else np.inf


def digest(result: Result) -> str:
    """Of image, ranges and depth."""
    reported = hashlib.sha256(result.image.tobytes())
    assert result.ranges is not None
    for values in (result.ranges.range_m, result.ranges.sigma_m, result.depth_m):
        reported.update(b"" if values is None else values.tobytes())
    return reported.hexdigest()


def drawn(frames: int, rng: np.random.Generator) -> Faults:
    """Faults by chance; neither a swapped frame nor the next has another one."""
    each = round(FRACTION * frames)
    swapped = 2 * rng.choice(frames // 2 - 1, each, replace=False)
    free = np.setdiff1d(np.arange(frames - 1), [swapped, swapped + 1])
    others = rng.permutation(free)[: 2 * each]
    corrupted, lost = others[:each], others[each:]
    return Faults(*(frozenset(map(int, some)) for some in (corrupted, lost, swapped)))


def run(capture: Capture, frames: int, faults: Faults) -> Run:
    """Receive and reconstruct what another process sends, on one thread as the program does."""
    threadpool_limits(1)
    source = TcpListen("tcp-listen://127.0.0.1:0", "127.0.0.1", 0)
    reception = Reception(source)
    digests: dict[int, str] = {}
    latencies: list[float] = []
    stamps_s: list[float] = []

    def note(outcome: Outcome) -> None:
        latencies.append(1e3 * outcome.latency_s)
        stamps_s.append(time.thread_time())
        digests[outcome.result.frame] = digest(outcome.result)

    loop = Loop(reception, results=[note])
    spawned = multiprocessing.get_context("spawn")
    sending = spawned.Process(target=send, args=(capture, frames, faults, source.port))
    receiving = threading.Thread(target=reception.run, daemon=True)
    receiving.start()
    sending.start()
    loop.run()
    receiving.join()
    sending.join()
    # Of the first, the methods are compiled.
    return Run(digests, reception.counts, np.array(latencies), 1e3 * np.diff(stamps_s))


def send(capture: Capture, frames: int, faults: Faults, port: int) -> None:
    """The process that sends, each message when its frame has been measured."""
    period_s = frame_period_s(capture.setup)
    messages = list(stream(capture, frames, faults))
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.sendall(messages[0])
        began_s = time.monotonic() + HEAD_START_S
        for number, message in enumerate(messages[1:]):
            time.sleep(max(began_s + number * period_s - time.monotonic(), 0))
            connection.sendall(message)


def stream(capture: Capture, frames: int, faults: Faults) -> Iterator[bytes]:
    """The setup, a message of each frame, and the end."""
    rng = np.random.default_rng(1)
    sender = Sender(capture.setup, capture.provenance, run=1)
    yield sender.setup()
    readings = [capture.frame(n) for n in range(DIFFERENT)]
    held = b""
    for number in range(frames):
        message = bytearray(sender.frame(readings[number % DIFFERENT]))
        if number in faults.corrupted:
            message[rng.integers(len(message))] ^= rng.integers(1, 256)
        if number in faults.lost:
            message.clear()
        if number in faults.swapped:
            held = bytes(message)
            yield b""
        else:
            yield bytes(message) + held
            held = b""
    yield sender.end()


if __name__ == "__main__":
    sys.exit(main())
