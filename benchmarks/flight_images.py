"""What poses add to the image of a flight: `recursive` with them, without them, and single frames.

    python benchmarks/flight_images.py [--quick] [--json] [--markdown] [--workers N]

The recordings are those of benchmarks/flight.py, made if the folder lacks them. Errors are those of
the image that fits the true one best, over its variance, after the first third of a second.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from flight_judging import WARM_UP_S
from flight_sets import MOTIONS, POSE_ERRORS, Flight, flights, load, with_error
from intervals import of_figure
from options import benchmark_options, finish

from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture import Capture
from spisim.transport.backend import use_threads
from spisim_paper.checks import Check, Table, surroundings

ROOT = Path(__file__).parents[1]
PAGE, FOLDER = ROOT / "docs" / "results" / "flights.md", ROOT / "out" / "flights"
INNER = "edge-preserving"
SINGLE, WITHOUT = "single frame", "without poses"
KINDS = ("exact", "correlated", "white")
PRESETS, WEATHERS = ("fog", "paper"), ("clear", "fog 50 m")
TURNS, MOVES = 1.5, 0.4
WORST_DB = -0.3


@dataclass(frozen=True)
class Outcome:
    """A flight's mean error in dB by what is known of its poses."""

    flight: Flight
    error_db: dict[str, float]

    def gain_db(self, kind: str, over: str = WITHOUT) -> float:
        """By how much the error is below another."""
        return self.error_db[over] - self.error_db[kind]


def main() -> int:
    """Reconstruct and print; the exit status is 1 if a promise is broken."""
    workers = {"type": int, "default": 1, "help": "processes that reconstruct"}
    options = benchmark_options(
        __doc__, "one preset", PAGE, folder=FOLDER, others={"--workers": workers}
    )
    presets = PRESETS[:1] if options.quick else PRESETS
    every = list(flights(options.folder, "judged", presets=presets, weathers=WEATHERS))
    with ProcessPoolExecutor(options.workers) as pool:
        outcomes = list(pool.map(outcome, every))
    around = surroundings(("spisim", "numpy", "scipy"))
    tables, checks = [table(outcomes)], promises(outcomes)
    return finish(options, PAGE, "flight-images", around, tables, checks)


def outcome(flight: Flight) -> Outcome:
    """Errors of a flight's images."""
    use_threads(1)
    capture = load(flight)
    assert capture.poses is not None
    without, recursive = replace(capture, poses=None), f"recursive:{INNER}"
    late = capture.poses.time_s - capture.poses.time_s[0] >= WARM_UP_S
    errors = {
        SINGLE: error_db(without, INNER, late),
        WITHOUT: error_db(without, recursive, late),
    }
    for kind in KINDS:
        stated = with_error(capture, POSE_ERRORS[kind], flight.seed)
        errors[kind] = error_db(stated, recursive, late)
    print(f"{flight.path.stem}: {errors[WITHOUT] - errors[KINDS[1]]:+.2f} dB", flush=True)
    return Outcome(flight, errors)


def error_db(capture: Capture, method: str, judged: Mask) -> float:
    """Mean error of the images of those ``judged`` frames that have a truth."""
    truth = capture.truth
    assert truth is not None
    depth = "flight" if capture.poses is not None else ()
    reconstruct = Reconstructor(capture.setup, image=method, depth=depth)
    errors = []
    for number in range(capture.frames):
        image = reconstruct(capture.batch(number, number + 1)).image
        if truth.knows(number) and judged[number]:
            errors.append(unexplained(image, truth.at(number).image))
    return float(10 * np.log10(np.mean(errors)))


def unexplained(image: Floats, true: Floats) -> float:
    """Fraction of the true image's variance that a multiple of another, plus a constant, leaves."""
    seen = np.isfinite(true)
    return float(1 - np.corrcoef(image[seen], true[seen])[0, 1] ** 2)


def table(outcomes: Sequence[Outcome]) -> Table:
    """Gains by motion, air and preset."""
    rows = []
    for preset in PRESETS:
        for weather in WEATHERS:
            for motion in MOTIONS:
                some = [o for o in outcomes if o.flight.cell == (motion, weather, preset)]
                if some:
                    gains = [gains_of(some, kind) for kind in KINDS]
                    single = gains_of(some, KINDS[1], SINGLE)
                    figures = [f"{g.mean():+.2f} ({g.min():+.2f} to {g.max():+.2f})" for g in gains]
                    rows.append(
                        (motion, weather, preset, str(len(some)), *figures,
                         f"{single.mean():+.2f} ({single.min():+.2f})")
                    )  # fmt: skip
    return Table(
        f"Gain of `recursive:{INNER}` with poses over that without, dB: mean (least to most) over "
        "flights, by the error of the stated poses; and over the single frame, correlated errors.",
        ("motion", "air", "preset", "flights", *KINDS, "over the single frame (least)"),
        rows,
    )


def gains_of(some: Sequence[Outcome], kind: str, over: str = WITHOUT) -> Floats:
    """Gains of some flights, dB."""
    return np.array([each.gain_db(kind, over) for each in some])


def promises(outcomes: Sequence[Outcome]) -> list[Check]:
    """What poses are to gain."""
    usual = KINDS[1]
    turning = [each for each in outcomes if each.flight.motion == "hover"]
    moving = [each for each in outcomes if each.flight.motion != "hover"]
    least = min(outcomes, key=lambda each: each.gain_db(usual))
    white = min(outcomes, key=lambda each: each.gain_db("white", SINGLE))
    return [
        _gain_check("gain by poses, turning, dB", turning, TURNS),
        _gain_check("gain by poses, moving, dB", moving, MOVES),
        Check("least gain of a flight, dB", least.gain_db(usual), WORST_DB, at_least=True),
        Check("least gain over the single frame, white errors, dB",
              white.gain_db("white", SINGLE), 0.0, at_least=True),
    ]  # fmt: skip


def _gain_check(name: str, some: Sequence[Outcome], limit: float) -> Check:
    gains = gains_of(some, KINDS[1])
    interval = of_figure(lambda which: gains[which].mean(), [o.flight.family for o in some])
    return Check(name, float(gains.mean()), limit, at_least=True, interval=interval)


if __name__ == "__main__":
    sys.exit(main())
