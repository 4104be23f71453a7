"""Single-photon sensors: a wall, two surfaces in a pixel, and flights of a nano-drone.

Each set is judged where nothing was fitted; `measured_wall.py`, `measured_surfaces.py` and
`measured_flights.py` say how.
"""

from collections.abc import Callable
from pathlib import Path

import measured_flights
import measured_surfaces
import measured_wall
import numpy as np
from intervals import of_figure, of_fraction, of_size
from matplotlib.figure import Figure
from measured_figures import Comparison, MeasuredSet

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument import load_instrument
from spisim_paper.checks import Check, Table

DEGREE = 3
QUICK_STEP, STEP = 40, 2  # of the pixels that are judged, every so manyth
#: What the sensor itself is off in these flights, in metres: medians, and the largest deviation.
FLIGHT_MEDIANS_M, FLIGHT_MAD_M = (-0.014, 0.031), 0.05
#: Frames that share an error: those of a second.
FRAMES_TOGETHER = 15
PLOTTED_M, PLOTTED_ZONES = (0.05, 0.13, 0.33), (4, 0)


def sampled(
    name: str, statistic: Callable[..., float], limit: float, *samples: Floats, together: int = 1
) -> Check:
    """A figure with its interval; so many rows of its samples that follow share an error."""
    groups = np.arange(len(samples[0])) // together
    interval = of_figure(
        lambda rows: statistic(*(each[rows] for each in samples)), groups, positive=True
    )
    return Check(name, statistic(*samples), limit, interval=interval)


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


def scatter_ratio(errors: Floats, bounds: Floats) -> float:
    """Standard deviation over the rms bound; an offset of all is the recording's."""
    return float(np.std(errors)) / rms(bounds)


def compare_wall(folder: Path, quick: bool) -> Comparison:
    """The preset `tmf8820` before a wall, at distances that nothing was fitted to."""
    measured, fitted = (measured_wall.read_wall(each) for each in (folder, measured_wall.SHIPPED))
    instrument = load_instrument("tmf8820")
    errors = measured_wall.wall_errors(measured, instrument, fitted)
    far, near = errors.far, ~errors.far
    ours, sensors = errors.delay_m[far], errors.sensor_m[far]
    before, after = errors.background_before[far], errors.background_after[far]
    checks = [
        sampled("shape beyond 160 mm, rms over peak", rms, 0.03, errors.shape[far]),
        sampled("shape beyond 160 mm, worst histogram", worst, 0.03, errors.shape[far]),
        sampled("shape below 160 mm, rms over peak", rms, 0.06, errors.shape[near]),
        sampled("total counts, rms", rms, 0.05, errors.total[far]),
        sampled("total counts, worst", worst, 0.05, errors.total[far]),
        sampled("background before the pulse, rms", rms, 0.1, before),
        sampled("background behind the pulse, rms", rms, 0.1, after),
        sampled("delay against the arm, mm rms", rms, 1.5, 1e3 * ours),
        sampled("error of our ranges over that of the sensor's", ratio, 1.0, ours, sensors),
        *_scatter(measured, fitted),
    ]
    rows = [
        (f"{1e3 * low:.0f} to {1e3 * high:.0f}", *_wall_row(errors, (low, high)))
        for low, high in ((0.02, 0.06), (0.06, 0.16), (0.16, 0.28), (0.28, 0.5))
    ]
    columns = ("distance, mm", "histograms", "shape, % of peak", "counts, %", "background, %",
               "our ranges, mm", "the sensor's, mm")  # fmt: skip
    tables = [Table("Wall, rms deviation by distance, of ranges with offset and slope free:",
                    columns, rows)]  # fmt: skip
    compared = (
        "Histograms of `tmf8820` at distances that nothing was fitted to: shape, counts, "
        "background, delays"
    )
    return Comparison(compared, checks, tables, _wall_picture(measured, fitted))


def _wall_row(errors: measured_wall.WallErrors, within_m: tuple[float, float]) -> tuple[str, ...]:
    rows = (errors.distance_m >= within_m[0] - 1e-9) & (errors.distance_m < within_m[1] - 1e-9)
    if not rows.any():
        return ("0", *5 * ("",))
    percents = (100 * rms(each[rows]) for each in (errors.shape, errors.total))
    both = np.concatenate([errors.background_before[rows], errors.background_after[rows]])
    ranges = (1e3 * rms(each[rows]) for each in (errors.delay_m, errors.sensor_m))
    numbers = (*percents, 100 * rms(both), *ranges)
    return (str(errors.shape[rows].size), *(f"{number:.2f}" for number in numbers))


def _scatter(measured: measured_wall.Wall, fitted: measured_wall.Wall) -> list[Check]:
    """Scatter of total counts about a smooth curve, simulated beside measured."""
    instrument = load_instrument("tmf8820")
    poses = measured.at(measured.distance_m >= measured_wall.NEAREST_DELAY_M - 1e-9)
    if poses.distance_m.size <= DEGREE + 1:
        return []
    bench = measured_wall.calibrated(fitted, instrument)
    delay = measured_wall.expected_delays(poses, instrument, bench)
    rng = np.random.default_rng(1)
    drawn = measured_wall.simulated(poses, instrument, bench, delay, rng)
    both = [_about_a_curve(poses.distance_m, each) for each in (drawn, poses.histograms)]
    poisson = 1 / np.sqrt(poses.histograms.sum(axis=-1))
    return [
        sampled("scatter of counts, simulated over measured", ratio, 1.25, *both),
        sampled("scatter of counts, measured over simulated", ratio, 1.25, *both[::-1]),
        sampled("scatter of counts over Poisson's", ratio, 3.0, both[1], poisson),
    ]


def _about_a_curve(distance_m: Floats, histograms: Floats) -> Floats:
    """Residuals (poses, zones) of the logarithm of counts about a cubic in that of distance."""
    x, y = np.log(distance_m), np.log(histograms.sum(axis=-1))
    curve = np.vander(x, DEGREE + 1)
    rest = y - curve @ np.linalg.lstsq(curve, y, rcond=None)[0]
    return np.asarray(rest * np.sqrt(x.size / (x.size - DEGREE - 1)))


def _wall_picture(measured: measured_wall.Wall, fitted: measured_wall.Wall) -> Figure:
    instrument = load_instrument("tmf8820")
    bench = measured_wall.calibrated(fitted, instrument)
    unseen = measured.at(~measured.fitted)
    nearest = [int(np.abs(unseen.distance_m - wanted).argmin()) for wanted in PLOTTED_M]
    poses = unseen.at(np.array(nearest))
    delay = measured_wall.expected_delays(poses, instrument, bench)
    expected = measured_wall.simulated(poses, instrument, bench, delay)
    picture = Figure(figsize=(10, 4), layout="constrained")
    for axes, zone in zip(picture.subplots(1, 2, sharey=True), PLOTTED_ZONES, strict=True):
        for number, distance_m in enumerate(poses.distance_m):
            axes.step(np.arange(128), poses.histograms[number, zone], where="mid", lw=1,
                      color=f"C{number}", label=f"{1e3 * distance_m:.0f} mm")  # fmt: skip
            axes.plot(expected[number, zone], "k:", lw=1.2)
        axes.set(yscale="log", xlabel="bin", title=f"zone {zone + 1}", ylim=(3, 3e6), xlim=(0, 80))
    picture.axes[0].set_ylabel("counts; dotted: simulated")
    picture.axes[0].legend()
    return picture


def compare_surfaces(folder: Path, quick: bool) -> Comparison:
    """Two surfaces in one pixel, in the pixels that the response is not of."""
    read = measured_surfaces.read_surfaces(folder)
    errors = measured_surfaces.surface_errors(read, QUICK_STEP if quick else STEP)
    both = np.isfinite(errors.error).all(axis=1)
    fraction = of_fraction(both, np.arange(both.size))
    checks = [Check("both surfaces found", float(both.mean()), 0.9, True, fraction)]
    rows = []
    for surface, name in enumerate(("first", "second")):
        error, bound, own = (
            each[both, surface] for each in (errors.error, errors.bound, errors.own_bound)
        )
        given = np.isfinite(errors.halves[:, surface])
        halves, halves_bound, sigma = (
            each[given, surface]
            for each in (errors.halves, errors.halves_bound, errors.halves_sigma)
        )
        checks += [
            sampled(f"{name}, scatter of halves over its bound", ratio, 1.3, halves, halves_bound),
            sampled(f"{name}, error over its bound", scatter_ratio, 1.3, error, bound),
        ]
        numbers = np.std(error), rms(bound), rms(own), rms(halves), rms(halves_bound)
        rows.append((name, *(f"{each:.1f}" for each in (*numbers,)), f"{rms(halves / sigma):.2f}"))
    columns = ("surface", "error", "bound", "bound of the sharp shape", "halves", "their bound",
               "z of halves, rms")  # fmt: skip
    title = (
        f"Surfaces, {both.size} pixels, in bins: error from what is called truth, less its mean, "
        "and difference between halves of the photons."
    )
    explained = (
        "The second error is the truth's: means of all photons in a gate, of noise, reflections "
        "and the wall behind the object too. Halves of a pixel's photons need no truth. Bounds are "
        "those of a Gaussian as wide as the response; that of its sharp edge is out of reach of "
        "any estimate with so few photons."
    )
    tables = [Table(title, columns, rows), Table(explained)]
    compared = "Delays by the ranging method `returns`, in pixels with 5 photons of either surface"
    return Comparison(compared, checks, tables)


def compare_flights(folder: Path, quick: bool) -> Comparison:
    """The preset `vl53l5cx` in the place of the sensor of each flight."""
    instrument = load_instrument("vl53l5cx")
    flights = sorted(path for path in folder.iterdir() if path.is_dir())
    if not flights:
        raise InputError(f"{folder}: holds no flight, a folder with {measured_flights.SENSOR}")
    rows, checks, alike = [], [], []
    picture = Figure(figsize=(10, 3.2), layout="constrained")
    panels = np.atleast_1d(picture.subplots(1, len(flights), sharey=True))
    for number, (each, axes) in enumerate(zip(flights, panels, strict=True)):
        flight = measured_flights.read_flight(each, instrument.tof.frame_time_s)
        ranges = measured_flights.simulated(instrument, flight.measured_m, number)
        middle = measured_flights.middle_of(ranges)
        errors = {"sensor": flight.middle_m, "simulated": middle}
        errors = {name: values - flight.range_m for name, values in errors.items()}
        alike.append(measured_flights.alike(flight, middle))
        checks += _flight_checks(each.name, errors["simulated"])
        texts = [f"{100 * np.nanmedian(e):+.1f}, {100 * mad(e):.1f}" for e in errors.values()]
        rows.append((each.name, str(middle.size), *texts, f"{100 * alike[-1].mean():.0f}"))
        for name, error in errors.items():
            axes.plot(flight.range_m, 100 * error, ".", ms=3, label=name)
        axes.set(xlabel="Vicon, m", title=each.name, ylim=(-20, 20))
    panels[0].set_ylabel("less Vicon, cm")
    panels[0].legend()
    together = np.concatenate(alike)
    groups = np.arange(together.size) // FRAMES_TOGETHER
    interval = of_fraction(together, groups)
    checks.append(Check("status alike", float(together.mean()), 0.9, True, interval))
    columns = ("flight", "frames", "sensor, cm", "simulated, cm", "status alike, %")
    title = "Flights, centre zones less Vicon: median, and median absolute deviation."
    compared = "Range of the centre zones of `vl53l5cx` one frame late, from the poses of Vicon"
    return Comparison(compared, checks, [Table(title, columns, rows)], picture)


def _flight_checks(name: str, error: Floats) -> list[Check]:
    """That median and deviation are within those of the sensor."""
    middle = float(np.mean(FLIGHT_MEDIANS_M))
    groups = np.arange(error.size) // FRAMES_TOGETHER
    median = of_figure(lambda rows: float(np.nanmedian(error[rows])) - middle, groups)
    off = abs(float(np.nanmedian(error)) - middle)
    limit = float(np.ptp(FLIGHT_MEDIANS_M)) / 2
    return [
        Check(f"{name}, median, m off {middle:g}", off, limit, interval=of_size(median)),
        sampled(f"{name}, median absolute deviation, m", mad, FLIGHT_MAD_M, error,
                together=FRAMES_TOGETHER),
    ]  # fmt: skip


SETS = (
    MeasuredSet(
        "tmf8820",
        "[cpsiff/SPAD-ICCP-Summer-School](https://github.com/cpsiff/SPAD-ICCP-Summer-School) "
        "@6d924f9, MIT",
        compare_wall,
        measured_wall.SHIPPED,
    ),
    MeasuredSet(
        "two-surfaces",
        "photon-efficient-imaging/full-waveform @29e57f1, no licence",
        compare_surfaces,
    ),
    MeasuredSet(
        "flight-vl53l5cx",
        "[ETH-PBL/Matrix_ToF_Drones](https://github.com/ETH-PBL/Matrix_ToF_Drones) @3924acd, GPL-3",
        compare_flights,
    ),
)
