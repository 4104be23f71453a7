"""First crossings of a threshold by a current with the noise of its amplifier, from draws.

No closed form covers a pulse about as long as the noise behind its amplifier is correlated, which
crosses by chance from below the threshold, and more than once from above. The draws are the same
every time.
"""

import math
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.special import ndtri

from reconstruction.base.arrays import Floats

#: Most draws of the noise, and values in all of them; half have the opposite sign of the others.
DRAWS, VALUES = 8192, 2**22
#: Standard deviations of a pulse on each side of its centre within which it is drawn.
AROUND = 4.5
#: Tabulated peaks over the threshold, in standard deviations of the noise at the peak: every STEP
#: from -LAST to LAST, and FAR_PEAKS up to FAR, beyond which the edges' slopes alone change.
STEP, LAST, FAR, FAR_PEAKS = 0.5, 4.0, 40.0, 8
#: Steps of the logarithm of shot noise between tables, and its least value.
SHOT_STEP, LEAST_SHOT = 0.7, 1e-3


@dataclass(frozen=True)
class Shape:
    """Standard deviations of a pulse of light and of the amplifier's response, both Gaussian."""

    pulse_s: float
    amplifier_s: float

    @property
    def sigma_s(self) -> float:
        """Standard deviation of the pulse behind the amplifier."""
        return math.hypot(self.pulse_s, self.amplifier_s)

    @property
    def peak_fraction(self) -> float:
        """Peak of the pulse behind the amplifier over that before it; the charge is preserved."""
        return self.pulse_s / self.sigma_s

    @property
    def step_s(self) -> float:
        """Time step that resolves pulse and noise behind the amplifier."""
        return min(self.sigma_s / 8, self.amplifier_s / 4)

    @property
    def impulses_s(self) -> float:
        """Distance of impulses before the amplifier that cannot be told from white noise."""
        return 0.8 * min(self.pulse_s, self.amplifier_s)

    @property
    def zero_crossings_hz(self) -> float:
        """Upward zero crossings per second of noise behind the amplifier, rms frequency."""
        return 1 / (2 * math.pi * math.sqrt(2) * self.amplifier_s)


def first_middles(
    shape: Shape,
    times_s: Floats,
    current: Floats,
    variance: Floats,
    threshold: float,
    refused: NDArray[np.bool_] | None = None,
) -> tuple[Floats, int]:
    """Midpoints of the first stay above a threshold, and the number of draws.

    Parameters
    ----------
    shape : Shape
        Of which the time step is that of `times_s`.
    times_s : (times,) array
        Even steps.
    current : (times,) array
        Mean current behind the amplifier.
    variance : (times,) array
        Variance behind the amplifier of noise that is always as intense as at a time before it.
    threshold : float
        In units of the current.
    refused : (times,) mask, optional
        Midpoints that get no stamp; a later one may.

    Returns
    -------
    middles_s : (n,) array
        Of the draws with a stamp.
    draws : int
        All of them.
    """
    noise = _noise(shape, times_s, variance)
    half = len(noise)
    # Minus infinity keeps draws apart: a stay starts and ends with its draw.
    paths = np.full((2 * half, times_s.size + 1), -np.inf, dtype=np.float32)
    paths[:half, 1:], paths[half:, 1:] = current + noise, current - noise
    flat = np.append(paths, np.float32(-np.inf))
    turns = np.flatnonzero(np.diff(flat > threshold)) + 1
    odd = np.arange(turns.size) % 2
    inside, outside = turns - odd, turns - 1 + odd
    past = (flat[inside] - threshold) / (flat[inside] - flat[outside])
    draw, number = np.divmod(inside, paths.shape[1])
    crossing = number - 1 + (outside - inside) * past
    middle = crossing.reshape(-1, 2).mean(axis=1)
    drawn = draw[::2]
    if refused is not None:
        stamped = ~refused[np.rint(middle).astype(np.intp)]
        middle, drawn = middle[stamped], drawn[stamped]
    first = np.unique(drawn, return_index=True)[1]
    return np.asarray(times_s[0] + shape.step_s * middle[first]), 2 * half


def _noise(shape: Shape, times_s: Floats, variance: Floats) -> Floats:
    """Noise (draws / 2, times): independent impulses behind the amplifier."""
    reach_s = 4 * shape.amplifier_s
    at = np.arange(times_s[0] - reach_s, times_s[-1] + reach_s, shape.impulses_s)
    response = np.exp(-(((times_s - at[:, None]) / shape.amplifier_s) ** 2) / 2)
    power = shape.impulses_s / (math.sqrt(math.pi) * shape.amplifier_s)
    response *= np.sqrt(power * np.interp(at, times_s, variance))[:, None]
    draws = max(min(DRAWS, VALUES // times_s.size), 512)
    impulses = _impulses(draws.bit_length() - 2, at.size)
    return np.asarray(impulses @ response.astype(np.float32))


@lru_cache(maxsize=4)
def _impulses(power: int, count: int) -> Floats:
    """Normal numbers (2^power, count) of a Sobol sequence, whose means converge fast."""
    from scipy.stats import qmc  # slow to import

    uniform = qmc.Sobol(count, seed=0).random_base2(power)
    return np.asarray(ndtri(uniform.clip(1e-9, 1 - 1e-9)), dtype=np.float32)


def lone_pulses(
    shape: Shape, peak: Floats, threshold: float, shot: Floats
) -> tuple[Floats, Floats]:
    """Fraction (...) of pulses with a stamp, and the standard deviation, s, of their stamps.

    Parameters
    ----------
    shape : Shape
    peak : (...) array
        Peak over the noise without a pulse.
    threshold : float
        Threshold over that noise.
    shot : (...) array
        Variance that a current as high as that noise adds, over that of the noise.
    """
    peak, shot = np.broadcast_arrays(peak, shot)
    margin = (peak - threshold) / np.sqrt(1 + shot * peak)
    at = np.arcsinh(np.clip(margin, -LAST, FAR))
    stamped, sigma_s = np.zeros(peak.shape), np.zeros(peak.shape)
    step, above = np.divmod(np.log(np.maximum(shot, LEAST_SHOT)) / SHOT_STEP, 1)
    for nearby, weight in ((step, 1 - above), (step + 1, above)):
        for each in np.unique(nearby):
            table = _table(round(shape.peak_fraction, 9), threshold, math.exp(SHOT_STEP * each))
            here = nearby == each
            likely, scatter = (values(at[here]) for values in table)
            stamped[here] += weight[here] * np.where(margin[here] < -LAST, 0, likely)
            sigma_s[here] += weight[here] * shape.sigma_s * scatter
    # An edge of a Gaussian is as steep as the root of the logarithm of peak over threshold.
    farthest = np.log(_peak(np.array(FAR), threshold, shot) / threshold)
    over = np.log(np.maximum(peak / threshold, 1))
    return stamped, sigma_s * np.sqrt(farthest / np.maximum(over, farthest))


def _peak(margin: Floats, threshold: float, shot: Floats | float) -> Floats:
    """Peak that is over the threshold by a margin, in standard deviations of its own noise."""
    middle = margin**2 * shot / 2
    return np.asarray(
        threshold + middle + margin * np.sqrt(middle * shot / 2 + shot * threshold + 1)
    )


@cache
def _table(
    peak_fraction: float, threshold: float, shot: float
) -> tuple[PchipInterpolator, PchipInterpolator]:
    """Fraction and scatter of stamps by arsinh of the peak over the threshold, in noise."""
    margins = np.append(np.arange(-LAST, LAST, STEP), np.geomspace(LAST, FAR, FAR_PEAKS))
    peaks = _peak(margins, threshold, shot)
    shape = Shape(peak_fraction, math.sqrt(1 - peak_fraction**2))
    times_s = np.arange(-AROUND, AROUND, shape.step_s)
    current, before = (np.exp(-((times_s / width) ** 2) / 2) for width in (1.0, peak_fraction))
    fractions, sigmas = np.zeros(peaks.size), np.ones(peaks.size)
    for number, peak in enumerate(np.maximum(peaks, 0)):
        variance = 1 + shot * peak / peak_fraction * before
        middles_s, draws = first_middles(shape, times_s, peak * current, variance, threshold)
        fractions[number] = middles_s.size / draws
        if middles_s.size > 1:
            sigmas[number] = middles_s.std()
    at = np.arcsinh(margins)
    return PchipInterpolator(at, fractions), PchipInterpolator(at, sigmas)
