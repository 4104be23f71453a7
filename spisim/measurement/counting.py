"""Counts of a single-photon diode in one exposure, with dead time and after-pulses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, ndtri

from spisim.instrument import Spad

Floats = NDArray[np.float64]

#: Mean counts above which the normal limit of the renewal process stands for its distribution.
LARGE_COUNT = 5000.0


def dead_time_per_primary(sensor: Spad) -> float:
    """Time that a primary detection and its cascade of after-pulses leave the diode blind."""
    return sensor.dead_time_s / (1 - sensor.afterpulse_probability)


def expected_counts(primaries: Floats, sensor: Spad, exposure_time_s: float) -> Floats:
    """Mean counts of so many detections as there would be without dead time.

    m = N / (1 + N τ / T), non-paralysable, after-pulses included.
    """
    blind = primaries * dead_time_per_primary(sensor) / exposure_time_s
    return np.asarray(primaries / (1 + blind) / (1 - sensor.afterpulse_probability))


def draw_counts(
    primaries: Floats, sensor: Spad, exposure_time_s: float, rng: np.random.Generator
) -> NDArray[np.int32]:
    """Draw counts (frames, ...) for mean detections `primaries`.

    Primary counts are a renewal process: k or more fit if k exponential waits end within T less
    (k - 1) dead times, P(m ≥ k) = P(k, (T - (k - 1) τ) N / T) with the regularised gamma function
    (J. W. Müller, Nucl. Instrum. Methods 112, 47 (1973)). Each leaves a geometric number of
    after-pulses, whose own blindness is put on the primary's account.
    """
    dead_s = dead_time_per_primary(sensor)
    flat, place = np.unique(primaries, return_inverse=True)
    uniform = rng.uniform(size=primaries.shape)
    counts = np.empty(primaries.shape)
    for number, mean in enumerate(flat):
        mine = place.reshape(primaries.shape) == number
        counts[mine] = _renewals(mean, dead_s / exposure_time_s, uniform[mine])
    extra = np.zeros(counts.shape)
    if sensor.afterpulse_probability > 0:
        some = counts > 0
        extra[some] = rng.negative_binomial(counts[some], 1 - sensor.afterpulse_probability)
    return np.asarray(counts + extra, dtype=np.int32)


def _renewals(mean: float, dead: float, uniform: Floats) -> Floats:
    """Inverse of the distribution of counts; `dead` is the dead time over the exposure."""
    expected = mean / (1 + mean * dead)
    spread = np.sqrt(mean / (1 + mean * dead) ** 3)
    if expected > LARGE_COUNT:
        return np.asarray(np.maximum(np.rint(expected + spread * ndtri(uniform)), 0))
    numbers = np.arange(1, int(expected + 12 * np.sqrt(expected) + 30))
    left = np.maximum(1 - (numbers - 1) * dead, 0)
    at_least = gammainc(numbers, mean * left)
    return np.searchsorted(1 - at_least, uniform, side="left").astype(np.float64)
