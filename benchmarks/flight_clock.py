"""Poses late by a constant: how well the memory of a flight finds out, and what it makes of it.

    python benchmarks/flight_clock.py [--quick] [--json] [--markdown]

Flights of 6 s that sway sideways or turn on the spot, in 50 m fog, through drawn worlds of families
that nothing was learned from; poses are off as an autopilot's, and late.
"""

import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from flight_judging import alone, judged, remembered, single_frames
from flight_sets import POSE_ERRORS, Flight, flights, load, with_error
from intervals import of_figure
from options import benchmark_options, finish

from reconstruction.capture.motion import PoseAt
from reconstruction.depth.memory import Remembered
from reconstruction.depth.memory.clock import ClockOffset
from spisim_paper.checks import Check, Table, surroundings

ROOT = Path(__file__).parents[1]
PAGE, FOLDER = ROOT / "docs" / "results" / "flights.md", ROOT / "out" / "flight-clock"
ERRORS = {
    "in time": POSE_ERRORS["correlated"],
    "in time, white": POSE_ERRORS["white"],
    "0.1 s late": POSE_ERRORS["correlated"].model_copy(update={"delay_s": 0.1}),
    "0.2 s late": POSE_ERRORS["correlated"].model_copy(update={"delay_s": 0.2}),
}
DURATION_S, FROM_S = 6.0, 3.0
PRESETS, WEATHER, MOTIONS = ("fog", "fog-steered"), "fog 50 m", ("sideways", "hover")
WRONGLY, GAIN = 0.05, 1.0


@dataclass(frozen=True)
class Outcome:
    """AbsRel of a flight's later frames: alone, with poses as stated, corrected; the last offset.

    `offset_s` is 0 where poses were taken as stated.
    """

    flight: Flight
    error: str
    single: float
    stated: float
    corrected: float
    offset_s: float


class AsStated(ClockOffset):
    """Takes poses as they are."""

    def corrected(self) -> PoseAt:
        """The stated pose."""
        return self._poses[-1]


def main() -> int:
    """Fly, judge and print; the exit status is 1 if a promise is broken."""
    workers = {"type": int, "default": 1, "help": "processes that judge"}
    options = benchmark_options(
        __doc__, "fixed spots alone", PAGE, folder=FOLDER, others={"--workers": workers}
    )
    every = flights(
        options.folder,
        "judged",
        presets=PRESETS[:1] if options.quick else PRESETS,
        weathers=(WEATHER,),
        motions=MOTIONS,
        duration_s=DURATION_S,
    )
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.workers) as pool:
        for some in pool.map(_outcomes, every):
            outcomes += some
            print(f"{some[0].flight.path.stem}: judged", flush=True)
    around = surroundings(("spisim", "numpy", "scipy"))
    tables, checks = [table(outcomes)], [*promises(outcomes)]
    return finish(options, PAGE, "flight-clock", around, tables, checks)


def _outcomes(flight: Flight) -> list[Outcome]:
    capture = load(flight)
    made = single_frames(capture)

    def abs_rel(maps: Sequence[Remembered | None]) -> float:
        frames = [each for each in judged(capture, maps, made) if each.time_s >= FROM_S]
        return float(np.mean([each.abs_rel for each in frames]))

    single = abs_rel(alone(made))
    outcomes = []
    for name, error in ERRORS.items():
        poses = with_error(capture, error, flight.seed)
        stated, corrected = (
            list(remembered(poses, made, clock)) for clock in (AsStated, ClockOffset)
        )
        offset_s = next(each.late_s for each in reversed(corrected) if each is not None)
        figures = single, abs_rel(stated), abs_rel(corrected), offset_s
        outcomes.append(Outcome(flight, name, *figures))
    return outcomes


def cells(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, str, str, list[Outcome]]]:
    """Outcomes by preset, motion and error of the poses."""
    for preset, motion, error in product(PRESETS, MOTIONS, ERRORS):
        some = [
            each
            for each in outcomes
            if (each.flight.preset, each.flight.motion, each.error) == (preset, motion, error)
        ]
        if some:
            yield preset, motion, error, some


def table(outcomes: Sequence[Outcome]) -> Table:
    """Offsets and errors by preset, motion and error of the poses."""
    rows = []
    for preset, motion, error, some in cells(outcomes):
        offsets_s = np.array([each.offset_s for each in some if each.offset_s])
        rows.append((
            preset, motion, error, f"{len(offsets_s)} of {len(some)}",
            f"{offsets_s.mean():.3f} ± {offsets_s.std():.3f}" if len(offsets_s) else "–",
            f"{_mean([each.stated / each.single for each in some]):.3f}",
            f"{_mean([each.corrected / each.single for each in some]):.3f}",
        ))  # fmt: skip
    return Table(
        f"Flights of {DURATION_S:g} s, by the error of their poses: those corrected at "
        "their end, by how much (mean and deviation), and AbsRel over that of the single frame "
        f"after {FROM_S:g} s with poses as stated and corrected.",
        ("preset", "motion", "poses", "flights corrected", "by, s", "as stated", "corrected"),
        rows,
    )


def promises(outcomes: Sequence[Outcome]) -> Iterator[Check]:
    """What is promised of unseen families."""
    in_time = [each for each in outcomes if not ERRORS[each.error].delay_s]
    wrongly = float(np.mean([each.offset_s != 0 for each in in_time]))
    yield Check("flights whose poses were corrected though synchronous", wrongly, WRONGLY)
    for error in (name for name, each in ERRORS.items() if each.delay_s):
        some = [each for each in outcomes if each.error == error]
        logs = np.log([each.corrected / each.stated for each in some])
        figure = of_figure(
            lambda which, logs=logs: float(np.exp(logs[which].mean())),  # type: ignore[misc]
            [each.flight.family for each in some],
            positive=True,
        )
        name = f"AbsRel with poses corrected over as stated, poses {error}"
        yield Check(name, float(np.exp(logs.mean())), GAIN, interval=figure)


def _mean(ratios: Sequence[float]) -> float:
    return float(np.exp(np.log(ratios).mean()))


if __name__ == "__main__":
    sys.exit(main())
