"""Light of targets in even fog, in closed form, as pencil beams and their detectors see it.

Written down anew, so that it shares nothing with the method that is tested.
"""

import numpy as np

from spisim.instrument import Instrument, SpotLight

PATHS = np.arange(4000) * 0.0125
STEP_M = 0.001
FIRST_M = 0.05


def seen(instrument: Instrument, range_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weights in sr and path lengths (spots, ranges): A cos / distance^2 of the aperture that sees.

    Along its beam a detector looks, so that the part of its aperture from which a place of the beam
    is within the field is where two circles overlap.
    """
    optics = instrument.spot_optics
    weights, paths = [], []
    for spot, direction in enumerate(optics.directions):
        position = optics.detector_positions_m[spot]
        ahead = range_m - position @ direction
        aside = np.linalg.norm(position - (position @ direction) * direction)
        distance = np.hypot(ahead, aside)
        area = common_area(
            optics.aperture_radii_m[spot], ahead * np.tan(optics.half_fields_rad[spot]), aside
        )
        weights.append(area * ahead / distance**3)
        paths.append(range_m + distance)
    return np.array(weights), np.array(paths)


def common_area(one: float, other: np.ndarray, apart: float) -> np.ndarray:
    """Of two circles."""
    with np.errstate(invalid="ignore", divide="ignore"):
        a = (apart**2 + one**2 - other**2) / (2 * apart * one)
        b = (apart**2 + other**2 - one**2) / (2 * apart * other)
        kite = (one + other - apart) * (apart + one - other) * (apart - one + other)
        kite = np.sqrt(kite * (apart + one + other)) / 2
        lens = one**2 * np.arccos(a) + other**2 * np.arccos(b) - kite
    inner = np.pi * np.minimum(one, other) ** 2
    return np.where(apart >= one + other, 0.0, np.where(apart <= abs(one - other), inner, lens))


def light(
    instrument: Instrument,
    ranges_m,
    *,
    reflectances=0.3,
    extinction_per_m=0.0,
    backscatter_per_sr=0.035,
    fog_m=(0.0, np.inf),
    steady_per_s=1e8,
    frames=1,
) -> SpotLight:
    """Light from targets at the spots' ranges, none where infinite, and of the fog before them.

    ``fog_m`` are the ranges at which the fog begins and ends.
    """

    def left(path_m: np.ndarray, at_m: np.ndarray) -> np.ndarray:
        foggy = np.clip(at_m, *fog_m) - fog_m[0]
        return np.exp(-extinction_per_m * path_m * foggy / at_m)

    spots = len(instrument.spot_optics.directions)
    ranges_m = np.broadcast_to(ranges_m, spots).astype(float)
    reflectances = np.broadcast_to(reflectances, spots)
    electrons = instrument.electrons_per_joule(instrument.tof.detector, "laser")
    per_s = electrons * instrument.lasers.power_w
    echo = np.zeros((spots, PATHS.size))
    lasts = np.minimum(ranges_m, PATHS[-1] / 2 - 0.1)
    every = np.arange(FIRST_M, lasts.max(), STEP_M) + STEP_M / 2
    weights, paths = seen(instrument, every)
    within = (every > fog_m[0]) & (every < fog_m[1])
    for spot, range_m in enumerate(ranges_m):
        before = np.s_[: len(np.arange(FIRST_M, lasts[spot], STEP_M))]
        positions, path = every[before], paths[spot, before]
        fog = within[before] * extinction_per_m * backscatter_per_sr * STEP_M
        deposit(echo[spot], path, fog * weights[spot, before] * left(path, positions))
        if np.isfinite(range_m):
            position = np.array([range_m])
            weight, path = seen(instrument, position)
            fraction = reflectances[spot] / np.pi * weight[spot]
            deposit(echo[spot], path[spot], fraction * left(path[spot], position))
    return SpotLight(
        PATHS,
        np.broadcast_to(per_s * echo, (frames, *echo.shape)),
        np.full((frames, spots), float(steady_per_s)),
        instrument.lasers.power_w,
    )


def deposit(bins: np.ndarray, path_m: np.ndarray, amount: np.ndarray) -> None:
    """Shared between the two nearest bins, so that the mean path stays."""
    position = path_m / (PATHS[1] - PATHS[0])
    low = position.astype(int)
    np.add.at(bins, low, amount * (low + 1 - position))
    np.add.at(bins, low + 1, amount * (position - low))
