"""Data sets on two cores: samples per minute, memory over time, and whether the light is right.

    python benchmarks/dataset.py [--quick] [--json] [--markdown]

Half of the samples are of the warehouse, half are calibration targets: 64 × 64 pixels, 128
patterns and four spots, fog of 50 m visibility, a transport noise share of 0.5.
`--markdown` pastes the tables into docs/results/datasets.md.
"""

import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from intervals import Indices, of_figure
from options import benchmark_options, finish
from same_light import same_light
from yardstick import Yardstick

from spisim.dataset.planned import PlannedSet, load_plan
from spisim.dataset.records import Outcome
from spisim.dataset.sample import Maker
from spisim.dataset.workers import LocalExecutor
from spisim_paper.checks import Check, Table, surroundings

# isort: split
import drjit as dr

DOCS = Path(__file__).parents[1] / "docs" / "results" / "datasets.md"
PLAN = """
name: benchmark
samples: 1000
scenes: [{scene: warehouse}, {family: targets}]
vary: {scene.fog: {kind: moderate-radiation, visibility_m: 50}}
transport_noise_share: 0.5
"""


#: Kernels of so many operations walk; those that set up and read out have fewer.
LARGE_OPERATIONS = 1000
#: Parts of a sample, by what does them; each stands where it is called from.
STAGES: dict[str, tuple[str, str]] = {
    "draw of the plan": ("spisim.dataset.planned", "PlannedSet.sample"),
    "scene and instrument": ("spisim.dataset.sample", "load"),
    "truth": ("spisim.simulation.chain", "ground_truth"),
    "media": ("spisim.simulation.light.solve", "build_world"),
    "steady light": ("spisim.simulation.light.solve", "steady_light"),
    "light of the image": ("spisim.simulation.light.solve", "transport_image"),
    "light of the spots": ("spisim.simulation.light.spots", "spot_histogram"),
    "counts": ("spisim.simulation.chain", "record"),
    "capture file": ("spisim.dataset.sample", "write_capture"),
}


@dataclass(frozen=True)
class Amounts:
    """How much work each part does."""

    alone: int  # samples of one worker
    settled: int  # after so many of them, scenes are kept in full and memory should grow no more
    together: int  # samples of two workers
    taken_apart: int  # samples whose time is told part by part
    compared: int  # small samples whose light is compared with another program's


FULL = Amounts(alone=500, settled=100, together=200, taken_apart=60, compared=100)
QUICK = Amounts(alone=20, settled=6, together=20, taken_apart=12, compared=10)


@dataclass(frozen=True)
class Pace:
    """What so many workers made, after a first sample each that nobody counts."""

    workers: int
    arrived_s: list[float]  # since the start
    outcomes: list[Outcome]

    @property
    def per_minute(self) -> float:
        """Samples per minute."""
        return 60 * len(self.outcomes) / self.arrived_s[-1]

    def row(self) -> tuple[str, ...]:
        """For the table."""
        each = [outcome.seconds or 0 for outcome in self.outcomes]
        peak = max(outcome.peak_memory_mb or 0 for outcome in self.outcomes)
        return (
            str(self.workers),
            str(len(self.outcomes)),
            f"{self.per_minute:.0f}",
            f"{np.median(each):.2f}",
            f"{max(each):.2f}",
            f"{peak:.0f}",
        )


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "rougher, in under a minute", DOCS)
    amounts = QUICK if options.quick else FULL

    around = surroundings(("spisim", "mitsuba", "drjit", "numpy"))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.yaml"
        path.write_text(PLAN)
        planned = load_plan(path)
        parts = taken_apart(planned, amounts.taken_apart)
        yardstick = Yardstick(laps=500, workers=2)
        yardstick.look()
        alone = measure(planned, amounts.alone, 1)
        yardstick.look()
        together = measure(planned, amounts.together, 2)
        yardstick.look()
    light, same = same_light(PLAN, amounts.compared)
    table = Table(
        "Samples: 64 × 64 pixels, 128 patterns, four spots, 50 m visibility, noise fraction 0.5:",
        ("workers", "samples", "per minute", "median, s", "slowest, s", "peak memory, MB"),
        [alone.row(), together.row()],
    )
    sample_s, sample_interval = yardstick.on_reference(60 / together.per_minute)
    gain = efficiency(alone, together)
    checks = [
        Check(
            "s per sample on the reference, two workers", sample_s, 0.2, interval=sample_interval
        ),
        Check("efficiency of two workers", gain, 0.85, True, yardstick.of_ratio(gain)),
        memory_growth(alone, amounts.settled),
        *same,
    ]
    return finish(options, DOCS, "benchmark", around, [table, *parts, light], checks)


def measure(planned: PlannedSet, samples: int, workers: int) -> Pace:
    """Make the first samples of the plan, in a folder that is removed again."""
    with (
        tempfile.TemporaryDirectory() as folder,
        LocalExecutor(Maker(planned, Path(folder)), workers) as executor,
    ):
        list(executor.run(range(samples, samples + workers)))  # start and compile
        began = time.perf_counter()
        outcomes, arrived_s = [], []
        for outcome in executor.run(range(samples)):
            outcomes.append(outcome)
            arrived_s.append(time.perf_counter() - began)
    failed = [outcome for outcome in outcomes if not outcome.done]
    if failed:
        raise RuntimeError(f"sample {failed[0].index} failed: {failed[0].error}")
    print(f"{workers} workers: {arrived_s[-1]:.0f} s", file=sys.stderr)
    return Pace(workers, arrived_s, outcomes)


def taken_apart(planned: PlannedSet, samples: int) -> list[Table]:
    """Processor time of each part of a sample, and what Dr.Jit did, on average per sample."""
    spent = dict.fromkeys(STAGES, 0.0)
    with tempfile.TemporaryDirectory() as folder:
        make = Maker(planned, Path(folder))
        _made(make, range(samples, 2 * samples))  # compile, and fill what is kept
        with _stopwatches(spent):
            began = time.process_time()
            _made(make, range(samples))
            total_s = time.process_time() - began
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            _made(make, range(samples))
            kernels = dr.kernel_history([dr.KernelType.JIT])
    rest = {"all else": total_s - sum(spent.values()), "together": total_s}
    rows = [
        (name, f"{1e3 * seconds / samples:.1f}", f"{100 * seconds / total_s:.0f}")
        for name, seconds in (spent | rest).items()
    ]
    large = [kernel for kernel in kernels if kernel["operation_count"] >= LARGE_OPERATIONS]
    compiled = sum(not kernel["cache_hit"] for kernel in kernels)
    codegen_ms = sum(kernel["codegen_time"] for kernel in kernels) / samples
    counts = (
        f"{len(kernels) / samples:.0f}",
        f"{len(large) / samples:.1f}",
        f"{codegen_ms:.1f}",
        f"{compiled / samples:.2f}",
    )
    return [
        Table(
            "Where the processor time of such a sample goes:",
            ("part", "ms", "% of all"),
            rows,
        ),
        Table(
            f"Kernels of such a sample (walks have {LARGE_OPERATIONS} operations and more):",
            ("launched", "of them walks", "writing their code, ms", "compiled anew"),
            [counts],
        ),
    ]


def _made(make: Callable[[int], Outcome], indices: range) -> None:
    for index in indices:
        outcome = make(index)
        if not outcome.done:
            raise RuntimeError(f"sample {index} failed: {outcome.error}")


@contextmanager
def _stopwatches(spent: dict[str, float]) -> Iterator[None]:
    """Add the processor time of each of `STAGES` to what is spent."""

    def timed(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def run(*args: Any, **kwargs: Any) -> Any:
            began = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                spent[name] += time.process_time() - began

        return run

    with ExitStack() as stack:
        for name, (module, path) in STAGES.items():
            owner: Any = import_module(module)
            *outer, function = path.split(".")
            for part in outer:
                owner = getattr(owner, part)
            watched = timed(name, getattr(owner, function))
            stack.enter_context(patch.object(owner, function, watched))
        yield


def efficiency(alone: Pace, together: Pace) -> float:
    """Time of one worker over twice that of two, for the samples that both made: the first ones."""
    return alone.arrived_s[len(together.outcomes) - 1] / (2 * together.arrived_s[-1])


def memory_growth(alone: Pace, settled: int) -> Check:
    """From the samples after the first ones to as many last ones: the median of their peaks.

    Not the largest, which more samples make larger even where nothing is kept of any.
    """
    peaks = np.array([outcome.peak_memory_mb or 0 for outcome in alone.outcomes])
    first, last = peaks[settled : 2 * settled], peaks[-settled:]

    def ratio(some: Indices) -> float:
        return float(np.median(last[some]) / np.median(first[some]))

    samples = np.arange(settled)
    interval = of_figure(ratio, samples, positive=True)
    return Check("memory of a worker, late over early", ratio(samples), 1.05, interval=interval)


if __name__ == "__main__":
    sys.exit(main())
