"""Single-photon sensors held against measurements: a wall, two surfaces in a pixel, flights.

    python benchmarks/measured_spad.py [--data FOLDER] [--quick] [--json] [--markdown]

Each set is judged where nothing was fitted (`measured_wall.py`, `measured_surfaces.py`,
`measured_flights.py` say how). Without a folder the wall alone is judged, on the few poses that are
shipped; the others may not be shipped. `--markdown` pastes tables into docs/results/measured.md.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import measured_flights
import measured_surfaces
import measured_wall
import numpy as np
from options import benchmark_options, finish

from reconstruction.base.arrays import Floats
from spisim.instrument import load_instrument
from spisim_paper.checks import Check, Interval, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "measured.md"
RESAMPLINGS = 2000
DEGREE = 3
QUICK_PIXELS, PIXELS = 40, 4  # every so manyth
#: What the sensor itself gives in these flights, in metres (median, median absolute deviation).
FLIGHT_MEDIANS_M, FLIGHT_MADS_M = (-0.014, 0.031), (0.01, 0.05)


def interval(figure: Callable[..., float], *samples: Floats) -> Interval:
    """Percentile bootstrap over the first axis, common to all samples."""
    rng = np.random.default_rng(1)
    size = len(samples[0])
    drawn = []
    for _ in range(RESAMPLINGS):
        rows = rng.integers(size, size=size)
        drawn.append(figure(*(each[rows] for each in samples)))

    def of(confidence: float) -> tuple[float, float]:
        low, high = np.nanquantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2])
        return float(low), float(high)

    return of


def figure(
    name: str,
    statistic: Callable[..., float],
    limit: float,
    *samples: Floats,
    at_least: bool = False,
) -> Check:
    """A named figure with its interval."""
    return Check(name, statistic(*samples), limit, at_least, interval(statistic, *samples))


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.nanmean(values**2)))


def worst(values: Floats) -> float:
    """Largest deviation."""
    return float(np.abs(values).max())


def mad(values: Floats) -> float:
    """Median absolute deviation from the median."""
    return float(np.nanmedian(np.abs(values - np.nanmedian(values))))


def ratio(errors: Floats, others: Floats) -> float:
    """Root mean square over that of others."""
    return rms(errors) / rms(others)


def wall(folder: Path) -> list[Check]:
    """Figures of `tmf8820` before a wall, from the poses of a folder that nothing was fitted to."""
    measured, fitted = (measured_wall.read_wall(each) for each in (folder, measured_wall.SHIPPED))
    instrument = load_instrument("tmf8820")
    errors = measured_wall.wall_errors(measured, instrument, fitted)
    far, near = errors.far, ~errors.far
    ours, sensors = errors.delay_m[far], errors.sensor_m[far]
    checks = [
        figure("wall, shape beyond 160 mm, rms over peak", rms, 0.03, errors.shape[far]),
        figure("wall, shape below 160 mm, rms over peak", rms, 0.06, errors.shape[near]),
        figure("wall, total counts, rms", rms, 0.05, errors.total[far]),
        figure("wall, total counts, worst", worst, 0.05, errors.total[far]),
        figure("wall, background before the pulse, rms", rms, 0.1, errors.background_before[far]),
        figure("wall, background behind the pulse, rms", rms, 0.1, errors.background_after[far]),
        figure("wall, delay against the arm, mm rms", rms, 1.5, 1e3 * ours),
        figure("wall, our range's error over the sensor's", ratio, 1.0, ours, sensors),
    ]
    return checks + scatter(measured, fitted)


def scatter(measured: measured_wall.Wall, fitted: measured_wall.Wall) -> list[Check]:
    """Scatter of total counts about a smooth curve, simulated over measured."""
    instrument = load_instrument("tmf8820")
    poses = measured.at(measured.distance_m >= measured_wall.NEAREST_DELAY_M - 1e-9)
    bench = measured_wall.calibrated(fitted, instrument)
    delay = measured_wall.expected_delays(poses, instrument, bench)
    rng = np.random.default_rng(1)
    drawn = measured_wall.simulated(poses, instrument, bench, delay, rng)
    both = [_about_a_curve(poses.distance_m, each) for each in (drawn, poses.histograms)]
    poisson = 1 / np.sqrt(poses.histograms.sum(axis=-1))
    return [
        figure("wall, scatter of counts, simulated over measured", ratio, 1.25, *both),
        figure("wall, scatter of counts, measured over simulated", ratio, 1.25, *both[::-1]),
        figure("wall, scatter of counts over Poisson's", ratio, 3.0, both[1], poisson),
    ]


def _about_a_curve(distance_m: Floats, histograms: Floats) -> Floats:
    """Residuals (poses, zones) of the logarithm of counts about a cubic in that of distance."""
    x, y = np.log(distance_m), np.log(histograms.sum(axis=-1))
    curve = np.polynomial.polynomial.polyvander(x, DEGREE)
    rest = y - curve @ np.linalg.lstsq(curve, y, rcond=None)[0]
    return np.asarray(rest * np.sqrt(x.size / max(x.size - DEGREE - 1, 1)))


def surfaces(folder: Path, step: int = PIXELS) -> tuple[list[Check], Table]:
    """Figures of two surfaces in one pixel, from the pixels that the response is not of."""
    read = measured_surfaces.read_surfaces(folder)
    errors = measured_surfaces.surface_errors(read, step)
    both = np.isfinite(errors.error).all(axis=1)
    checks = [figure("surfaces, both found", _mean, 0.9, both.astype(float), at_least=True)]
    rows = []
    for surface, name in enumerate(("first", "second")):
        error, bound, own, halves, halves_bound, halves_sigma = (
            each[:, surface] for each in vars(errors).values()
        )
        error, bound, own = error[both], bound[both], own[both]
        given = np.isfinite(halves)
        halves, halves_bound = halves[given], halves_bound[given]
        checks.append(
            figure(f"surfaces, {name}, halves over their bound", ratio, 1.3, halves, halves_bound)
        )
        if surface == 0:
            checks.append(
                figure("surfaces, first, error over its bound", _scatter_ratio, 1.3, error, bound)
            )
        stated = rms(halves / halves_sigma[given])
        numbers = np.std(error), rms(bound), rms(own), rms(halves), rms(halves_bound), stated
        rows.append((name, *(f"{each:.3g}" for each in numbers)))
    columns = ("surface", "error", "bound", "bound of the sharp shape", "halves", "their bound",
               "halves, z rms")  # fmt: skip
    title = (
        f"Two surfaces, {both.size} pixels, in bins: error from what is called truth, less its "
        "mean, and difference between halves of the photons."
    )
    return checks, Table(title, columns, rows)


def _mean(values: Floats) -> float:
    return float(np.mean(values))


def _scatter_ratio(errors: Floats, bounds: Floats) -> float:
    """Standard deviation over the rms bound; a common offset is the recording's."""
    return float(np.std(errors)) / rms(bounds)


def flights(folder: Path) -> tuple[list[Check], Table]:
    """Figures of `vl53l5cx` in the place of the sensor of each flight, and a table of both."""
    instrument = load_instrument("vl53l5cx")
    rows, checks, alike = [], [], []
    for number, each in enumerate(sorted(path for path in folder.iterdir() if path.is_dir())):
        flight = measured_flights.read_flight(each, instrument.tof.frame_time_s)
        ranges = measured_flights.simulated(instrument, flight.measured_m, number)
        middle = measured_flights.middle_of(ranges)
        errors = [middle - flight.range_m, flight.middle_m - flight.range_m]
        alike.append(measured_flights.alike(flight, middle).astype(float))
        name = f"flight {each.name}"
        off = abs(float(np.nanmedian(errors[0])) - np.mean(FLIGHT_MEDIANS_M))
        checks += [
            Check(f"{name}, median, m off the middle of the sensor's", off,
                  float(np.ptp(FLIGHT_MEDIANS_M)) / 2),
            figure(f"{name}, median absolute deviation, m", mad, FLIGHT_MADS_M[1], errors[0]),
        ]  # fmt: skip
        texts = [f"{100 * np.nanmedian(e):+.1f}, {100 * mad(e):.1f}" for e in errors]
        rows.append((each.name, str(middle.size), *texts, f"{100 * alike[-1].mean():.0f}"))
    together = np.concatenate(alike)
    checks.append(figure("flights, status alike", _mean, 0.9, together, at_least=True))
    columns = ("flight", "frames", "simulated, cm", "sensor, cm", "status alike, %")
    title = "Centre zones less Vicon: median, and median absolute deviation."
    return checks, Table(title, columns, rows)


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(
        __doc__,
        "a tenth of the pixels",
        DOCS,
        others={"--data": {"type": Path, "help": "folder with tmf8820, two-surfaces and flights"}},
    )
    tables: list[Table] = []
    data = options.data
    checks = wall(measured_wall.SHIPPED if data is None else data / "tmf8820")
    if data is not None:
        step = QUICK_PIXELS if options.quick else PIXELS
        sets = surfaces(data / "two-surfaces", step), flights(data / "flight-vl53l5cx")
        checks += [check for each, _ in sets for check in each]
        tables = [table for _, table in sets]
    around = surroundings(("spisim", "numpy", "scipy"))
    return finish(options, DOCS, "measured-spad", around, tables, checks)


if __name__ == "__main__":
    sys.exit(main())
