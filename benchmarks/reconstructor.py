"""Reconstructor: time and memory per frame against the length of the recording.

    python benchmarks/reconstructor.py [--quick] [--json] [--markdown]

64 × 64 pixels, 127 patterns and four spots: a simulated frame of the warehouse as often as the
recording is long, for the pursuit's work depends on what a frame shows. Then the default frame of
two instruments, part by part, with no, one and ten readings of each frame that failed, others each
time. What is compared takes turns, so that a busy machine slows all alike. `--markdown` pastes the
tables into docs/results/reconstruction.md.
"""

import os
import subprocess
import sys
import tempfile
import tracemalloc
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from time import thread_time

import numpy as np
from intervals import Indices, of_figure
from options import benchmark_options, finish
from yardstick import processor

import spisim
from reconstruction import Reconstructor, open_capture, reconstruct, write_capture
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture, CaptureFile, Frames, Truth
from reconstruction.capture.readings.cw import CwSpots
from spisim_paper.checks import Check, Interval, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "reconstruction.md"
FRAMES = (1, 1_000, 10_000)
BATCH = 16
INSTRUMENTS, FAILED = ("paper", "fog"), (0, 1, 10)
MAX_MS = 8.5
"""Of a core, for a frame: what 15,000 patterns a second leave."""
LOOK_EVERY = 20
"""Calls between two looks at how slow the machine is."""
BATCHED = 1_000


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "fewer calls of each", DOCS)
    calls = 40 if options.quick else 400
    around = surroundings(("spisim", "numpy", "scipy", "h5py"))
    one = spisim.simulate(
        spisim.load_scene("warehouse"), spisim.load_instrument("paper"), spp=16
    ).capture
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        files = [
            stack.enter_context(open_capture(recording(one, frames, Path(folder))))
            for frames in FRAMES
        ]
        tables, checks = flat(files, calls)
        tables.append(ways(files[1], calls))
        checks.append(cold_start(Path(folder), 5 if options.quick else 15))
    for name in INSTRUMENTS:
        table, more_checks = default_frame(name, calls)
        tables.append(table)
        checks += more_checks
    tables.append(in_batches(one))
    return finish(options, DOCS, "benchmark", around, tables, checks)


def recording(one: Capture, frames: int, folder: Path) -> Path:
    """File of a recording of so many frames, all alike."""
    assert isinstance(one.spots, CwSpots)
    assert one.truth is not None
    counts, taps = (
        np.repeat(values, frames, axis=0) for values in (one.buckets.counts, one.spots.taps)
    )
    path = folder / f"{frames}.h5"
    capture = replace(
        one,
        buckets=replace(one.buckets, counts=counts, saturated=np.zeros(counts.shape, bool)),
        spots=replace(one.spots, taps=taps, saturated=np.zeros(taps.shape, bool)),
        truth=Truth.of([one.truth.at(0)], still=True),
    )
    write_capture(capture, path)
    return path


def flat(files: Sequence[CaptureFile], calls: int) -> tuple[list[Table], list[Check]]:
    """Time and memory per frame by the number of frames."""
    work = [one_by_one(file) for file in files]
    turns = in_turns(work, calls)
    seconds = np.median(turns, axis=0)
    memory = [peak_memory(each) for each in work]
    rows = [
        (f"{frames:,}", f"{1e3 * time_s:.2f}", f"{memory_b / 1e6:.2f}")
        for frames, time_s, memory_b in zip(FRAMES, seconds, memory, strict=True)
    ]
    table = Table(
        "A frame read from its file and reconstructed, by the length of the recording:",
        ("frames", "per frame, ms", "peak memory of a call, MB"),
        rows,
    )
    checks = []
    for n, frames in list(enumerate(FRAMES))[1:]:
        where = f"per frame at {frames:,} frames, over that at 1"
        time, interval = quotient(turns[:, n], turns[:, 0])
        checks.append(Check(f"time {where}", time, 1.1, interval=interval))
        checks.append(Check(f"memory {where}", memory[n] / memory[0], 1.1))
    return [table], checks


def ways(file: CaptureFile, calls: int) -> Table:
    """Ways to reconstruct the same frames."""
    reconstructor = Reconstructor(file.setup)
    image_alone = Reconstructor(file.setup, image="pursuit", ranging=(), depth=())
    batch = file.batch(0, BATCH)
    frames = [batch.between(n, n + 1) for n in range(BATCH)]
    work: dict[str, Callable[[], object]] = {
        "compiled call": lambda: [reconstructor(frame) for frame in frames],
        "compiled call, image alone": lambda: [image_alone(frame) for frame in frames],
        f"batches of {BATCH}": lambda: reconstructor.batch(batch),
        "compiled for each frame": lambda: [reconstruct(file, n) for n in range(BATCH)],
    }
    seconds = np.median(in_turns(list(work.values()), max(calls // 20, 3)), axis=0)
    rows = [
        (name, f"{1e3 * each / BATCH:.2f}", f"{each / seconds[0]:.2f}")
        for name, each in zip(work, seconds, strict=True)
    ]
    return Table("The same frames in several ways:", ("", "per frame, ms", "over the first"), rows)


def default_frame(instrument: str, calls: int) -> tuple[Table, list[Check]]:
    """Processor time of a default frame, and by part on the clock, by how many readings failed."""
    capture = spisim.simulate(
        spisim.load_scene("warehouse"), spisim.load_instrument(instrument), spp=16, frames=8
    ).capture
    reconstructor = Reconstructor(capture.setup)
    rng = np.random.default_rng(0)
    seconds: dict[int, list[float]] = {each: [] for each in FAILED}
    parts: dict[int, list[dict[str, float]]] = {each: [] for each in FAILED}
    yardstick = processor()
    for call in range(calls):
        if call % LOOK_EVERY == 0:
            yardstick.look()
        for failed in FAILED:
            frame = with_failed(capture.frame(call % capture.frames), failed, rng)
            began = thread_time()
            result = reconstructor(frame)
            seconds[failed].append(thread_time() - began)
            parts[failed].append(dict(result.timings_s))
    medians = {failed: 1e3 * float(np.median(each)) for failed, each in seconds.items()}
    names = list(parts[0][0])
    rows = [
        (
            f"{failed}",
            f"{medians[failed]:.2f}",
            *(f"{1e3 * np.median([each[name] for each in parts[failed]]):.2f}" for name in names),
        )
        for failed in FAILED
    ]
    title = f"A default frame of the instrument {instrument}, by failed readings, ms:"
    sound_ms, interval = yardstick.on_reference(medians[0])
    name = f"{instrument}: a sound frame, ms of a core of the reference"
    checks = [Check(name, sound_ms, MAX_MS, interval=interval)]
    checks += [
        Check(f"{instrument}: with {failed} failed readings, over a sound one", ratio, 1.5)
        for failed in FAILED[1:]
        for ratio in [medians[failed] / medians[0]]
    ]
    return Table(title, ("failed", "processor time", *names), rows), checks


def with_failed(frame: Frames, failed: int, rng: np.random.Generator) -> Frames:
    """A frame of which so many readings but the first and the last, on which all rest, failed."""
    saturated = frame.buckets.saturated.copy()
    saturated[0, 1 + rng.choice(saturated.shape[1] - 2, failed, replace=False)] = True
    return replace(frame, buckets=replace(frame.buckets, saturated=saturated))


def in_batches(one: Capture) -> Table:
    """Frames a second of a batch, by what is made of them."""
    frames = first_frames(one, BATCHED)
    rows = []
    for title, methods in (
        ("defaults", {}),
        ("least-squares alone", {"image": "least-squares", "ranging": (), "depth": ()}),
    ):
        reconstructor = Reconstructor(one.setup, **methods)
        reconstructor(one.frame())
        began = thread_time()
        reconstructor.batch(frames)
        rows.append((title, f"{BATCHED / (thread_time() - began):,.0f}"))
    return Table(f"A batch of {BATCHED:,} frames:", ("", "frames a second"), rows)


def first_frames(one: Capture, frames: int) -> Frames:
    """The frame of a capture so many times."""
    assert isinstance(one.spots, CwSpots)
    counts, taps = (
        np.repeat(each, frames, axis=0) for each in (one.buckets.counts, one.spots.taps)
    )
    alone = one.frame()
    return replace(
        alone,
        buckets=replace(one.buckets, counts=counts, saturated=np.zeros(counts.shape, bool)),
        spots=replace(one.spots, taps=taps, saturated=np.zeros(taps.shape, bool)),
    )


def one_by_one(file: CaptureFile) -> Callable[[], object]:
    """Read and reconstruct the next frame of a file, from its start again after the last."""
    reconstructor = Reconstructor(file.setup)
    frame = 0

    def work() -> object:
        nonlocal frame
        frame = (frame + 1) % file.frames
        return reconstructor(file.frame(frame))

    return work


def in_turns(work: Sequence[Callable[[], object]], calls: int) -> Floats:
    """Processor times (calls, work)."""
    seconds = np.empty((calls, len(work)))
    for each in work:
        each()
    for call in range(calls):
        for n, each in enumerate(work):
            began = thread_time()
            each()
            seconds[call, n] = thread_time() - began
    return seconds


def quotient(above: Floats, below: Floats) -> tuple[float, Interval]:
    """Median of one time over that of another, of the same turns, and its interval."""

    def of(some: Indices) -> float:
        return float(np.median(above[some]) / np.median(below[some]))

    turns = np.arange(len(above))
    return of(turns), of_figure(of, turns, positive=True)


def cold_start(folder: Path, runs: int) -> Check:
    """Least processor time of the command, from the start of Python to its end."""
    capture, out = folder / f"{FRAMES[0]}.h5", folder / "out"
    command = [sys.executable, "-m", "reconstruction", str(capture), "-o", str(out)]
    seconds, yardstick = [], processor()
    for _ in range(runs):
        yardstick.look()
        before = os.times()
        subprocess.run(command, check=True, capture_output=True)
        after = os.times()
        used = after.children_user + after.children_system
        seconds.append(used - before.children_user - before.children_system)
    min_s, interval = yardstick.on_reference(min(seconds))
    name = "processor time of the command for one frame on the reference, s"
    return Check(name, min_s, 0.8, interval=interval)


def peak_memory(work: Callable[[], object]) -> float:
    """Most bytes that a call holds at a time."""
    work()
    tracemalloc.start()
    work()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return float(peak)


if __name__ == "__main__":
    sys.exit(main())
