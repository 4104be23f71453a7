"""A live stream while everything goes wrong at once.

    python benchmarks/live_troubles.py [--quick] [--json] [--markdown]

The stream of `live.py`, with all of this at the same time: an image method that raises in every
frame, a sink that raises for every result, a caller before the rig that says nothing and keeps its
connection, in the middle of the stream a header of 16 MiB that never come, and one reading in a
hundred saturated, others in each frame. Where that is the one of all pixels or the dark one,
nothing tells the level, and the frame is told to have failed. A second sink, which is sound, gets
what there is. Every 50th result is compared with that of the same frame from memory. `--markdown`
pastes the tables into docs/results/live.md.
"""

import multiprocessing
import socket
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from intervals import of_quantile
from options import benchmark_options, finish
from threadpoolctl import threadpool_limits
from yardstick import Yardstick

import spisim
from live import HEAD_START_S, MAX_LATENCY_MS, digest, percentile
from reconstruction import Capture, Reconstructor
from reconstruction.capture import Frames
from reconstruction.chosen_methods import USUAL_IMAGES
from reconstruction.image import IMAGE_METHODS
from spisim_live import Counts, Loop, Outcome, Reception, Sender, frame_period_s
from spisim_live.framing import MAX_PAYLOAD_BYTES, Kind, Message, header
from spisim_live.links.sockets import TcpListen
from spisim_live.loop import fast_depth
from spisim_live.sinks import Detached, Sink
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "live.md"
SECONDS, QUICK_S = 60, 10
DIFFERENT = 32
"""Frames whose readings differ, sent over and over."""
FAILED = 0.01
"""Of the readings of each frame."""
COMPARED = 50
"""One result in so many is computed again."""
SETTLED_S = 5.0
"""After which memory should not grow."""
FAILING = "failing"


class FailingMethod:
    """Meets a singular matrix in every frame."""

    title = "one that fails"

    def compile(self, operator: object):
        """A solver that raises."""

        def solve(coefficients: object) -> None:
            raise np.linalg.LinAlgError("Singular matrix")

        return solve


class FailingSink(Sink):
    """Takes nothing."""

    def result(self, outcome: Outcome) -> None:
        """Raise."""
        raise ValueError("Out of range float values are not JSON compliant")


class CountingSink(Sink):
    """Counts what it gets, `waiting` for it as long as need be."""

    waiting = 256

    def __init__(self) -> None:
        self.results = 0

    def result(self, outcome: Outcome) -> None:
        """One more."""
        self.results += 1


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a stream: some digests by number, counts, latencies in ms, memory in MiB."""

    digests: dict[int, str]
    counts: Counts
    latencies_ms: np.ndarray
    processor_ms: np.ndarray
    settled_mib: float
    grown_mib: float
    retained: int
    lost: int


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, f"{QUICK_S} s", PAGE)
    IMAGE_METHODS._loaded[FAILING] = FailingMethod()
    capture = spisim.simulate(
        spisim.load_scene("warehouse"), spisim.load_instrument("paper"), spp=16, frames=DIFFERENT
    ).capture
    frames = round((QUICK_S if options.quick else SECONDS) / frame_period_s(capture.setup))
    yardstick = Yardstick()
    yardstick.look()
    result = run(capture, frames)
    yardstick.look()
    latency_ms, latency_interval = yardstick.on_reference(
        percentile(result.latencies_ms, 99), of_quantile(result.latencies_ms, 0.99)
    )
    counts = result.counts
    reported = counts.dropped + counts.failed + counts.lost + counts.corrupted
    columns = (
        *("frames", "results", "failed", "dropped", "failures of the method", "of the sink"),
        *("latency, median, ms", "99 %, ms", "most, ms", "processor time of a frame, median, ms"),
        *("memory, MiB", "growth, MiB"),
    )
    figures = [percentile(result.latencies_ms, fraction) for fraction in (50, 99, 100)]
    figures += [percentile(result.processor_ms, 50), result.settled_mib, result.grown_mib]
    numbers = [frames, counts.reconstructed, counts.failed, counts.dropped]
    numbers += [counts.method_failures, counts.sink_failures]
    rows = [(*map(str, numbers), *(f"{each:.1f}" for each in figures))]
    checks = [
        Check("frames without a result, not reported", frames - counts.reconstructed - reported, 0),
        Check("frames dropped", counts.dropped, 0),
        Check("wrong results, of those compared", wrong(capture, result), 0),
        Check(
            "failures of the method, not reported",
            counts.reconstructed - counts.method_failures,
            0,
        ),
        Check("failures of the sink, not reported", result.lost - counts.sink_failures, 0),
        Check("results that the sound sink lacks", counts.reconstructed - result.retained, 0),
        Check("false headers, not reported", 1 - counts.given_up, 0),
        Check(
            "latency, 99 %, ms on the reference",
            latency_ms,
            MAX_LATENCY_MS,
            interval=latency_interval,
        ),
        Check("growth of memory, MiB", result.grown_mib, 16),
    ]
    title = f"{frames} frames at {1 / frame_period_s(capture.setup):.1f} a second:"
    around = surroundings(("spisim", "numpy", "scipy"))
    return finish(options, PAGE, "troubles", around, [Table(title, columns, rows)], checks)


def run(capture: Capture, frames: int) -> Run:
    """Receive and reconstruct what another process sends, on one thread as the program does."""
    threadpool_limits(1)
    counts = Counts()
    good = CountingSink()
    sinks = [Detached(FailingSink(), "failing", counts), Detached(good, "good", counts)]
    source = TcpListen("tcp-listen://127.0.0.1:0", "127.0.0.1", 0)
    reception = Reception(source, counts=counts)
    digests: dict[int, str] = {}
    latencies: list[float] = []
    stamps_s: list[float] = []
    memory: list[float] = []
    settled = min(round(SETTLED_S / frame_period_s(capture.setup)), frames // 4)

    def note(outcome: Outcome) -> None:
        latencies.append(1e3 * outcome.latency_s)
        stamps_s.append(time.thread_time())
        if outcome.result.frame % COMPARED == 0:
            digests[outcome.result.frame] = digest(outcome.result)
        if len(latencies) >= settled and len(latencies) % 50 == 0:
            memory.append(resident_mib())

    loop = Loop(
        reception,
        image=[USUAL_IMAGES[0], FAILING],
        results=[note, *(each.result for each in sinks)],
        states=[each.state for each in sinks],
    )
    spawned = multiprocessing.get_context("spawn")
    sending = spawned.Process(target=send, args=(capture, frames, source.port))
    receiving = threading.Thread(target=reception.run, daemon=True)
    with socket.create_connection(("127.0.0.1", source.port)):  # and says nothing
        for each in sinks:
            each.start()
        receiving.start()
        sending.start()
        loop.run()
    receiving.join()
    sending.join()
    for each in sinks:
        each.close()
    return Run(
        digests,
        counts,
        np.array(latencies),
        1e3 * np.diff(stamps_s),
        memory[0] if memory else np.nan,
        max(memory) - memory[0] if memory else np.nan,
        good.results,
        sinks[0].lost,
    )


def send(capture: Capture, frames: int, port: int) -> None:
    """The process that sends, each message when its frame has been measured."""
    period_s = frame_period_s(capture.setup)
    messages = list(stream(capture, frames))
    with socket.create_connection(("127.0.0.1", port)) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.sendall(messages[0])
        began_s = time.monotonic() + HEAD_START_S
        for number, message in enumerate(messages[1:]):
            time.sleep(max(began_s + number * period_s - time.monotonic(), 0))
            connection.sendall(message)


def stream(capture: Capture, frames: int) -> Iterator[bytes]:
    """The setup, a message of each frame, and the end; before the middle one a false header."""
    sender = Sender(capture.setup, capture.provenance, run=1)
    yield sender.setup()
    false = header(Message(Kind.SETUP), MAX_PAYLOAD_BYTES)
    for number in range(frames):
        message = sender.frame(outliers(capture, number))
        yield false + message if number == frames // 2 else message
    yield sender.end()


def outliers(capture: Capture, number: int) -> Frames:
    """A frame of which some readings are saturated."""
    frame = capture.frame(number % DIFFERENT)
    chance = np.random.default_rng((2, number)).random(frame.buckets.saturated.shape)
    saturated = frame.buckets.saturated | (chance < FAILED)
    return replace(frame, buckets=replace(frame.buckets, saturated=saturated))


def wrong(capture: Capture, result: Run) -> int:
    """Results other than those of the same frames from memory, in any bit."""
    setup = capture.setup
    reconstruct = Reconstructor(setup, image=USUAL_IMAGES[0], depth=fast_depth(setup))
    expected = {
        number: digest(reconstruct(replace(outliers(capture, number), first=number)))
        for number in result.digests
    }
    return sum(expected[number] != each for number, each in result.digests.items())


def resident_mib() -> float:
    """Memory of this process that is in use; nan where the system does not report it."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return np.nan
    return pages * 4096 / 2**20


if __name__ == "__main__":
    sys.exit(main())
