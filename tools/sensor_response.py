"""Fits the response of a preset of zones to a wall: pulse, tail, near overlap, diodes and speckle.

    python tools/sensor_response.py [FOLDER]

Prints the fields of `spisim/instrument/presets/tmf8820.yaml` that come from measurements, from the
poses of `benchmarks/measured_wall.py` that may be fitted. The shape is the sensor's own reference
histogram behind one kernel of exponentials, as the reference diodes have a longer tail than those
of the zones.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.constants import c
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares, minimize_scalar

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))
import measured_wall as bench

from reconstruction.base.arrays import Floats
from reconstruction.ranging.histogram import coates
from spisim.instrument import Instrument, load_instrument
from spisim.instrument.response import Response

#: Time constants of the kernel, in bins.
TAUS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
#: Steps per bin of the shape, and its ends in bins about the reference's first.
FINE, BEFORE, LAST = 16, 8, 128
#: Samples of the preset, in bins about the pulse: fine at its edge, coarse in its tail.
SAMPLES = np.concatenate([np.arange(-3, 4, 0.25), np.arange(4, 12, 0.5), np.arange(12, 32.1, 2)])
BINS_FITTED = (4, 45)


def shapes(reference: Floats) -> tuple[Floats, Floats]:
    """Times (samples,) in bins, and the reference (1 + taus, samples), bare and behind each tau."""
    arrived = np.concatenate([[0.0], np.cumsum(reference / reference.sum())])
    spline = CubicSpline(np.arange(reference.size + 1.0), arrived)
    times = np.arange(-BEFORE, LAST, 1 / FINE)
    bare = np.where((times > 0) & (times < reference.size), spline(times, 1), 0.0)
    tails = [np.exp(-np.arange(0, LAST, 1 / FINE) / tau) / (tau * FINE) for tau in TAUS]
    return times, np.array([bare, *(np.convolve(bare, tail)[: times.size] for tail in tails)])


def response_of(wall: bench.Wall, instrument: Instrument) -> Response:
    """Shape that fits the pulses of all zones and poses, about its own delay."""
    times, parts = shapes(wall.reference.mean(axis=0))
    arrived = np.cumsum(parts, axis=1) / FINE
    relative, part = bench.spread(instrument)
    slant = bench.calibrated(wall, instrument).slant
    middle = bench.delays(wall, instrument) + bench.reference_delay(wall)
    away = (slant * wall.distance_m[:, None])[..., None] * (relative - 1)
    delay = middle[..., None] + away * 2 / (c * instrument.tof.bin_width_s)
    rate = coates(wall.histograms, bench.cycles(instrument))[0]
    rate = rate - rate[..., : bench.QUIET].mean(axis=-1)[..., None]
    edges = np.arange(rate.shape[-1] + 1.0)

    def fit(shift: float) -> tuple[Floats, float]:
        rows, values = [], []
        for pose, zone in np.ndindex(*rate.shape[:2]):
            y, peak = rate[pose, zone], int(rate[pose, zone].argmax())
            near = slice(peak - BINS_FITTED[0], min(peak + BINS_FITTED[1], y.size - 1))
            at = edges[near.start : near.stop + 1] - delay[pose, zone][:, None] - shift
            steps = [part[zone] @ np.diff(np.interp(at, times, each)) for each in arrived]
            scale = y[near].sum()
            weight = 1 / np.sqrt(np.maximum(y[near] / scale, 0) + 0.2)
            rows.append(np.array(steps).T * weight[:, None])
            values.append(weight * y[near] / scale)
        design, value = np.vstack(rows), np.concatenate(values)
        weights = np.linalg.lstsq(design, value, rcond=None)[0]
        return weights, float(np.sum((design @ weights - value) ** 2))

    start = -float(times[parts[0].argmax()])
    best = minimize_scalar(lambda s: fit(s)[1], bounds=(start - 2, start + 2), method="bounded")
    weights, _ = fit(best.x)
    print("# kernel", np.round(weights, 3), "of", TAUS, "bins, shift", round(best.x, 3))
    at = np.interp(SAMPLES, times + best.x, np.maximum(weights @ parts, 0), left=0, right=0)
    bin_ns = 1e9 * instrument.tof.bin_width_s
    rows = [
        (round(t, 4), round(v, 5)) for t, v in zip(SAMPLES * bin_ns, at / at.max(), strict=True)
    ]
    return Response(samples_ns=rows)


def overlap_of(wall: bench.Wall, instrument: Instrument) -> tuple[Floats, float]:
    """Near overlap (zones,) in metres, and the scatter of the light about it without Poisson's."""
    range_m = bench.calibrated(wall, instrument).slant * wall.distance_m[:, None]
    echo, _ = bench.arrivals(wall, instrument)
    zones = echo.shape[1]

    def error(theta: Floats) -> Floats:
        setback, light, near = theta[0], theta[1 : 1 + zones], theta[1 + zones :]
        expected = light - 2 * np.log(wall.distance_m[:, None] + setback) - (near / range_m) ** 2
        return np.asarray((np.log(echo) - expected).ravel())

    solved = least_squares(error, [0.0, *np.log(echo[-1] * range_m[-1] ** 2), *zones * [0.05]])
    far = wall.distance_m >= bench.NEAREST_DELAY_M
    logs = np.log(echo[far])
    curve = np.vander(np.log(wall.distance_m[far]), 4)
    smooth = curve @ np.linalg.lstsq(curve, logs, rcond=None)[0]
    freedom = far.sum() / (far.sum() - curve.shape[1])
    scatter = freedom * np.mean((logs - smooth) ** 2) - np.mean(1 / echo[far])
    return np.abs(solved.x[1 + zones :]), float(np.sqrt(max(scatter, 0)))


def bin_width_of(wall: bench.Wall, instrument: Instrument) -> float:
    """Width of a bin in seconds, from the zone that looks straight ahead."""
    zone = int(np.argmax(instrument.zones.directions[:, 2]))
    far = wall.distance_m >= bench.NEAREST_DELAY_M - 1e-9
    delay = bench.delays(wall, instrument)[far, zone]
    rays = np.linalg.norm(instrument.zones.points(bench.PARTS)[zone], axis=-1)
    range_m = wall.distance_m[far] * np.sum(bench.spread(instrument)[1][zone] * rays)
    return float(2 / (c * np.polyfit(range_m, delay, 1)[0]))


def cycles_of(wall: bench.Wall) -> float:
    """Cycles of a frame: of those that the pulse leaves, the fraction that the background shows.

    As the background before the pulse is to that behind it, so are all cycles to those left.
    """
    counts = wall.histograms
    before = counts[..., : bench.QUIET].mean(axis=-1)
    peak = counts.argmax(axis=-1)
    after = counts[..., 90:].mean(axis=-1)
    echo = counts.sum(axis=-1) - before * peak - after * (counts.shape[-1] - peak)
    use = (wall.distance_m[:, None] >= 0.04) & (before > 40) & (after < 0.8 * before)
    return float(np.median(echo[use] / (1 - after[use] / before[use])))


def main() -> None:
    """Fit and print."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else bench.SHIPPED
    wall = bench.read_wall(folder)
    wall = wall.at(wall.fitted & (wall.distance_m >= bench.NEAREST_FITTED_M - 1e-9))
    instrument = load_instrument("tmf8820")
    print(f"# cycles {cycles_of(wall):.4g}")
    width_s = bin_width_of(wall, instrument)
    print(f"bin_width_s: {width_s:.5g}")
    near, scatter = overlap_of(wall, instrument)
    print(f"near_overlap_m: {np.round(near, 4).tolist()}")
    print(f"speckle_contrast: {scatter:.2g}")
    far = wall.at(wall.distance_m >= 0.099)
    print(
        f"samples_ns: {[list(map(float, row)) for row in response_of(far, instrument).samples_ns]}"
    )


if __name__ == "__main__":
    main()
