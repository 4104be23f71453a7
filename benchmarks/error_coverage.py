"""How many estimates of light lie within one, two and four of the errors stated with them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from room import air, room
from scipy.constants import c
from scipy.stats import t

import spisim
from reconstruction.base.arrays import Floats
from spisim.atmosphere import CLEAR, fog
from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene
from spisim.simulation.light.stated_error import image_error, spot_error
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.sampling import MIN_LAUNCHES, ErrorMetric, PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world
from spisim_paper.checks import Check, Table

BINS = PathLengthBins(4001, 0.02)
#: Bins that make up this much of all variance: the others hold a path now and then.
VARIANCE_RETAINED = 0.99
SPOT_PATHS = 1024
#: Runs of the spots, of which there are four with a few numbers each, for one of the image.
SPOT_RUNS = 12
#: Percentage points by which estimates within one and two errors, and beyond four, may differ from
#: Student's.
LIMITS = (3.0, 2.0, 0.5)
HALF_ANGLE_RAD = np.radians(12)


@dataclass(frozen=True)
class Case:
    """A scene of images, and paths per pixel."""

    name: str
    scene: Scene
    paths: int


def cases() -> Iterator[Case]:
    """The benchmark's room, the same in fog with its whole phase function, and a target."""
    whole = fog(50, "moderate-radiation")
    yield Case("clear", room(CLEAR), 8)
    yield Case("50 m", room(air(50)), 8)
    yield Case("50 m", room(air(50)), 256)
    yield Case("20 m", room(air(20)), 64)
    yield Case("10 m", room(air(10)), 64)
    yield Case("50 m, Mie", room(whole), 64)
    target = spisim.load_scene("target-siemens-star")
    yield Case("target, 50 m, Mie", replace(target, atmosphere=whole), 64)


def stated_errors(
    instrument: Instrument, runs: int, shape: tuple[int, int]
) -> tuple[Table, list[Check]]:
    """Coverage of what is stated of pixels, path-length bins, taps and phasors."""
    student = student_coverage(MIN_LAUNCHES - 1)
    rows, chi2 = [], []

    def off_student(name: str, paths: int, estimates: Floats, errors: Floats) -> Floats:
        result = coverage(estimates, errors)
        squares = float(np.mean(estimates.var(axis=0, ddof=1)) / np.mean(errors**2))
        below = 100 * float(np.mean(estimates < others(estimates)[0]))
        rows.append((name, str(paths), *_cells(result), f"{below:.0f} %", f"{squares:.2f}"))
        chi2.append(squares)
        return np.abs(result - student)

    off = [
        off_student(f"image, {case.name}", case.paths, *images(case, instrument, runs, shape))
        for case in cases()
    ]
    readings, bins_off = [], []
    for name, scene in (("clear", room(CLEAR)), ("50 m", room(air(50))), ("10 m", room(air(10)))):
        bins, few = spots(scene, instrument, SPOT_RUNS * runs)
        bins_off.append(off_student(f"spots' bins, {name}", SPOT_PATHS, *bins))
        readings.append(np.array(few) / np.sqrt(np.mean(few[1] ** 2)))
    together = np.concatenate(readings, axis=-1)
    off.append(off_student("spots' taps and phasors, all three", SPOT_PATHS, *together))
    rows.append((f"Student's t of {MIN_LAUNCHES} launches", "", *_cells(student), "50 %", "1"))
    title = (
        "Of estimates, how many lie within one and two, and beyond four, of the errors that are "
        f"stated with them; {runs} runs of {shape[0]} × {shape[1]} pixels, {SPOT_RUNS * runs} of "
        "the spots, each held against the mean of all others, whose own error is included. χ² is "
        "the variance of the runs over the mean square of their stated errors. Of the bins, those "
        f"that make up {100 * VARIANCE_RETAINED:.0f} % of the variance."
    )
    columns = ("light", "paths", "within 1", "within 2", "beyond 4", "below the mean", "χ²")
    names = ("coverage_1_off_student", "coverage_2_off_student", "coverage_4_off_student")
    worst = map(float, np.max(off, axis=0))
    return Table(title, columns, rows), [
        *(Check(*each) for each in zip(names, worst, LIMITS, strict=True)),
        Check("bins_coverage_4_off_student", float(np.max(bins_off, axis=0)[2]), LIMITS[2]),
        Check("chi2_stated", max(chi2), 1.2),
    ]


def images(
    case: Case, instrument: Instrument, runs: int, shape: tuple[int, int]
) -> tuple[Floats, Floats]:
    """Estimates and stated errors of the image (runs, pixels)."""
    placed = InstrumentView.placed(case.scene, instrument)
    projector = replace(placed.projector, shape=shape)
    detector = replace(placed.bucket, half_angle_rad=HALF_ANGLE_RAD)
    world = build_world(case.scene)
    result = [
        transport_image(
            world, projector, detector, PathBudget(case.paths), seed=np.random.SeedSequence(run)
        )
        for run in range(runs)
    ]
    errors = [image_error(each, shape).ravel() for each in result]
    return np.array([each.mean["image"] for each in result]), np.array(errors)


def spots(
    scene: Scene, instrument: Instrument, runs: int
) -> tuple[tuple[Floats, Floats], tuple[Floats, Floats]]:
    """Estimates and stated errors of bins (runs, bins), and of taps and phasors (runs, numbers)."""
    placed = InstrumentView.placed(scene, instrument)
    world = build_world(scene)
    phase = 2 * np.pi * instrument.tof.modulation.frequencies_hz[0] / c * BINS.centres_m
    waves = np.stack([(1 + np.cos(phase)) / 2, (1 + np.sin(phase)) / 2, np.cos(phase)])
    stated: list[tuple[Floats, Floats]] = []

    def readings(sums: Mapping[str, Floats]) -> Floats:
        return np.asarray(waves @ sums["histogram"].T)

    def keep(mean: Floats, error: Floats) -> float:
        stated.append((mean.ravel(), error.ravel()))
        return float(np.linalg.norm(error))

    budget = PathBudget(SPOT_PATHS, error_metric=ErrorMetric(readings, keep))
    result = [
        spot_histogram(
            world, placed.beams, placed.tof, BINS, budget, seed=np.random.SeedSequence(run)
        )
        for run in range(runs)
    ]
    bins = np.array([each.mean["histogram"].ravel() for each in result])
    errors = np.array([spot_error(each).ravel() for each in result])
    retained = _maximum(bins.var(axis=0))
    mean, error = (np.array(each) for each in zip(*stated, strict=True))
    return (bins[:, retained], errors[:, retained]), (mean, error)


def coverage(estimates: Floats, errors: Floats) -> Floats:
    """Percent of independent estimates (runs, cells) within one, within two, beyond four errors.

    Off the mean of all other runs, whose own variance is added to that which is stated.
    """
    mean, variance = others(estimates)
    off = np.abs(estimates - mean) / np.sqrt(errors**2 + variance)
    return 100 * np.array([np.mean(off < 1), np.mean(off < 2), np.mean(off > 4)])


def others(estimates: Floats) -> tuple[Floats, Floats]:
    """Mean of the runs but each, and the variance of that mean, (runs, cells) both."""
    count = len(estimates) - 1
    mean = (estimates.sum(axis=0) - estimates) / count
    squares = np.sum((estimates - estimates.mean(axis=0)) ** 2, axis=0)
    squares = squares - (estimates - mean) ** 2 * count / (count + 1)
    return mean, np.maximum(squares, 0) / ((count - 1) * count)


def student_coverage(degrees: int) -> Floats:
    """The same of Student's t."""
    law = t(degrees)
    return 100 * np.array([1 - 2 * law.sf(1), 1 - 2 * law.sf(2), 2 * law.sf(4)])


def _maximum(variance: Floats) -> Floats:
    """The fewest cells that make up `VARIANCE_RETAINED`."""
    order = np.argsort(variance)[::-1]
    fraction = np.cumsum(variance[order]) / variance.sum()
    return np.asarray(order[: np.searchsorted(fraction, VARIANCE_RETAINED) + 1])


def _cells(result: Floats) -> tuple[str, str, str]:
    return f"{result[0]:.1f} %", f"{result[1]:.1f} %", f"{result[2]:.2f} %"
