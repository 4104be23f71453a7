"""A TMF8820 before a wall: what was measured, how it stood there, and what the preset gives of it.

The measurements are those of cpsiff/SPAD-ICCP-Summer-School, MIT licensed; some are shipped in
`benchmarks/data/tmf8820`. Whatever is fitted, here and in the preset (`tools/sensor_response.py`),
is fitted at the multiples of `FITTED_STEP_M` alone.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.constants import c
from scipy.optimize import least_squares

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.ranging.histogram import coates, find_pulses
from spisim.instrument import Instrument, SpotLight
from spisim.simulation.light.path_bins import bins_for, split_light

SHIPPED = Path(__file__).parent / "data" / "tmf8820"
FILE = "wall_distances.json"
FITTED_STEP_M = 0.02
#: Nearer, lenses and wall overlap so little that nothing is fitted, and too little is there to see.
NEAREST_M, NEAREST_FITTED_M, NEAREST_DELAY_M = 0.02, 0.04, 0.16
#: Bins about the peak of a histogram that hold its pulse.
BEFORE, AFTER = 3, 20
#: Bins before any pulse, which hold the background alone.
QUIET = 11
#: Last bins, behind any pulse.
LATE = 38
#: So many cycles that no arrival of the reference hides another.
MANY_CYCLES = 10**12
#: Points per side of a zone.
PARTS = 4


@dataclass(frozen=True, eq=False)
class Wall:
    """Histograms (poses, zones, bins) at distances (poses,), and what the sensor makes of them."""

    distance_m: Floats
    histograms: Floats
    reference: Floats
    """(poses, bins): the sensor's own picture of its pulse."""
    reported_m: Floats
    """(poses, zones): its first range."""

    def at(self, chosen: Floats) -> "Wall":
        """Some of the poses."""
        return Wall(*(each[chosen] for each in vars(self).values()))

    @property
    def fitted(self) -> Floats:
        """Mask (poses,) of those that anything may be fitted to."""
        steps = self.distance_m / FITTED_STEP_M
        return np.asarray(np.abs(steps - np.round(steps)) < 0.05)


@dataclass(frozen=True, eq=False)
class Bench:
    """How a sensor stood before a wall: what no preset can know. Each (zones,)."""

    slant: Floats
    """Range over distance."""
    delay: Floats
    """Delay of a range of zero, in bins from that of the reference."""
    light: Floats
    """Arrivals of a frame times m² of a wall beyond the near overlap."""
    background: Floats
    """Arrivals per bin and frame far from the wall."""
    shade_m: Floats
    """The sensor shades what it sees: exp(-(shade / distance)²) of the background is left."""
    setback_m: float
    """How far behind the point that the distance counts from light starts to spread."""


def read_wall(folder: Path) -> Wall:
    """Poses of a folder with `wall_distances.json`, by distance."""
    path = folder / FILE
    if not path.is_file():
        raise InputError(f"{path}: no such file; cpsiff/SPAD-ICCP-Summer-School has it")
    poses = sorted(json.loads(path.read_text("utf-8")), key=lambda pose: pose["dist_to_plane"])
    return Wall(
        np.array([pose["dist_to_plane"] for pose in poses]),
        np.array([pose["hists"] for pose in poses], dtype=float),
        np.array([pose["reference_hist"] for pose in poses], dtype=float),
        1e-3 * np.array([pose["distances"][0]["depths_1"] for pose in poses], dtype=float),
    )


def spread(instrument: Instrument) -> tuple[Floats, Floats]:
    """Ranges over their mean, and light of sum one, of points of a wall in zones (zones, points).

    cos⁷: twice along the way and its square to and fro, and into the aperture.
    """
    slant = np.linalg.norm(instrument.zones.points(PARTS), axis=-1)
    vignetting = instrument.ranging.tof.detector.vignetting
    light = slant ** -(7 + instrument.zones.flood_falloff + vignetting)
    light /= light.sum(axis=1, keepdims=True)
    return slant / np.sum(light * slant, axis=1, keepdims=True), light


def cycles(instrument: Instrument) -> int:
    """Cycles of a frame, each of which stamps one arrival at most."""
    return instrument.tof.pulses * instrument.tof.diodes


def delays(wall: Wall, instrument: Instrument) -> Floats:
    """Delays (poses, zones) that the ranging method `dtof` reads, in bins after the reference."""
    flat = wall.histograms.reshape(-1, wall.histograms.shape[-1])
    read = find_pulses(flat, cycles(instrument), None).delay.reshape(wall.histograms.shape[:2])
    return read - reference_delay(wall)


def reference_delay(wall: Wall) -> Floats:
    """Delay (poses, 1) of the reference, which the laser's driver shifts as it warms."""
    return find_pulses(wall.reference, MANY_CYCLES, None).delay[:, None]


def arrivals(wall: Wall, instrument: Instrument) -> tuple[Floats, Floats]:
    """Echo (poses, zones) and background per bin of all diodes in a frame, pile-up undone."""
    rate = coates(wall.histograms, cycles(instrument))[0] * cycles(instrument)
    quiet = rate[..., :QUIET].mean(axis=-1)
    return np.sum(rate - quiet[..., None], axis=-1), quiet


def calibrated(wall: Wall, instrument: Instrument) -> Bench:
    """The bench from the poses that may be fitted."""
    wall = wall.at(wall.fitted & (wall.distance_m >= NEAREST_FITTED_M - 1e-9))
    distance = wall.distance_m[:, None]
    far = wall.distance_m >= NEAREST_DELAY_M - 1e-9
    slope, delay = np.polyfit(wall.distance_m[far], delays(wall, instrument)[far], 1)
    slant = slope * c * instrument.tof.bin_width_s / 2
    echo, quiet = arrivals(wall, instrument)
    seen = overlap(instrument, slant * distance)

    def light_error(setback_m: Floats) -> Floats:
        logs = np.log(echo * (distance + setback_m) ** 2 / seen)
        return (logs - logs.mean(axis=0)).ravel()

    setback_m = float(least_squares(light_error, np.zeros(1)).x[0])
    light = np.exp(np.mean(np.log(echo * (distance + setback_m) ** 2 / seen), axis=0))
    background, shade_m = np.transpose([_shaded(wall.distance_m, zone) for zone in quiet.T])
    return Bench(slant, delay, light, background, shade_m, setback_m)


def overlap(instrument: Instrument, range_m: Floats) -> Floats:
    """Fraction (poses, zones) of the light of a wall that zones see."""
    return np.array([np.diag(instrument.zones.overlap(2 * row)) for row in range_m])


def _shaded(distance_m: Floats, quiet: Floats) -> Floats:
    """Background and shade of a zone, by least squares of Poisson counts."""

    def error(theta: Floats) -> Floats:
        return np.sqrt(quiet) - np.sqrt(theta[0]) * np.exp(-((theta[1] / distance_m) ** 2) / 2)

    return np.asarray(least_squares(error, [quiet[-1], 0.05]).x)


def expected_delays(wall: Wall, instrument: Instrument, bench: Bench) -> Floats:
    """Delays (poses, zones) in bins after the reference."""
    per_m = 2 / (c * instrument.tof.bin_width_s)
    return bench.delay + bench.slant * wall.distance_m[:, None] * per_m


def simulated(
    wall: Wall,
    instrument: Instrument,
    bench: Bench,
    delay: Floats,
    rng: np.random.Generator | None = None,
) -> Floats:
    """Histograms (poses, zones, bins) on that bench, with pulses at these delays (poses, zones).

    Without `rng`, the expected ones.
    """
    tof, distance = instrument.tof, wall.distance_m[:, None]
    start_m = c * (tof.bin_width_s * (delay + reference_delay(wall)) - tof.stamping.delay_offset_s)
    relative, part = spread(instrument)
    range_m = bench.slant * distance
    path_m = start_m[..., None] + 2 * range_m[..., None] * (relative - 1)
    lengths = bins_for(tof, np.full(1, np.nan)).centres_m
    echoes = overlap(instrument, range_m) * bench.light / (distance + bench.setback_m) ** 2
    per_pulse = tof.pulse_sigma_s * np.sqrt(2 * np.pi) * tof.pulses
    echo = np.zeros((*range_m.shape, lengths.size))
    for pose, zone in np.ndindex(*range_m.shape):
        echo[pose, zone] = split_light(path_m[pose, zone], part[zone], lengths)
    echo *= (echoes / per_pulse)[..., None]
    ambient = bench.background * np.exp(-((bench.shade_m / distance) ** 2))
    light = SpotLight(
        lengths, echo, ambient / (tof.pulses * tof.bin_width_s), instrument.zones.power_w
    )
    return np.asarray(tof.record(light, instrument.spot_optics, rng).counts, dtype=np.float64)


def shape_residual(measured: Floats, expected: Floats) -> Floats:
    """Rms residual (poses, zones) over the bins of each pulse, over its peak, at equal counts."""
    expected = expected * (measured.sum(axis=-1) / expected.sum(axis=-1))[..., None]
    peak = measured.argmax(axis=-1)[..., None]
    bins = np.clip(peak + np.arange(-BEFORE, AFTER + 1), 0, measured.shape[-1] - 1)
    rest = np.take_along_axis(measured - expected, bins, axis=-1)
    return np.asarray(np.sqrt(np.mean(rest**2, axis=-1)) / measured.max(axis=-1))


@dataclass(frozen=True, eq=False)
class WallErrors:
    """Measured less expected, each (poses, zones); relative, or in metres."""

    distance_m: Floats
    """(poses,)."""
    far: Floats
    """(poses,): beyond the near overlap."""
    shape: Floats
    """At the measured delays and counts, which are judged by themselves."""
    total: Floats
    background_before: Floats
    background_after: Floats
    delay_m: Floats
    sensor_m: Floats
    """The sensor's own ranges, its offset and slope fitted as ours are."""


def wall_errors(wall: Wall, instrument: Instrument, fitted: Wall) -> WallErrors:
    """Errors at the poses of a wall that nothing was fitted to."""
    bench = calibrated(fitted, instrument)
    wall = wall.at(~wall.fitted & (wall.distance_m >= NEAREST_M))
    delay = expected_delays(wall, instrument, bench)
    read = delays(wall, instrument)
    expected, measured = simulated(wall, instrument, bench, delay), wall.histograms
    aligned = simulated(wall, instrument, bench, read)
    late = slice(-LATE, None)

    def relative(part: slice) -> Floats:
        counts = [each[..., part].sum(axis=-1) for each in (measured, expected)]
        return np.asarray(counts[0] / counts[1] - 1)

    usable = fitted.at(fitted.fitted & (fitted.distance_m >= NEAREST_DELAY_M - 1e-9))
    slope, offset = np.polyfit(usable.distance_m, usable.reported_m, 1)
    bin_m = c * instrument.tof.bin_width_s / 2
    return WallErrors(
        distance_m=wall.distance_m,
        far=wall.distance_m >= NEAREST_DELAY_M - 1e-9,
        shape=shape_residual(measured, aligned),
        total=relative(slice(None)),
        background_before=relative(slice(QUIET)),
        background_after=relative(late),
        delay_m=(read - delay) * bin_m / bench.slant,
        sensor_m=(wall.reported_m - offset) / slope - wall.distance_m[:, None],
    )
