"""Counts of a single-photon diode in one exposure, with dead time and after-pulses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spisim.instrument import Spad

Floats = NDArray[np.float64]

#: Mean counts above which the normal limit of the renewal process stands for its distribution.
LARGE_COUNT = 1000.0


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

    A renewal process: an exponential wait, a detection with a geometric number of after-pulses,
    and a dead time for each of them (J. W. Müller, Nucl. Instrum. Methods 112, 47 (1973)). Many
    counts are normal, of variance (1 + p) N / (1 + N τ / T)³ / (1 - p)².
    """
    expected = expected_counts(primaries, sensor, exposure_time_s)
    many = expected > LARGE_COUNT
    counts = np.empty(primaries.shape)
    counts[~many] = _events(primaries[~many], sensor, exposure_time_s, rng)
    p = sensor.afterpulse_probability
    blind = primaries[many] * dead_time_per_primary(sensor) / exposure_time_s
    deviation = np.sqrt((1 + p) * primaries[many] / (1 + blind) ** 3) / (1 - p)
    counts[many] = np.rint(rng.normal(expected[many], deviation))
    return counts.astype(np.int32)


def _events(
    primaries: Floats, sensor: Spad, exposure_time_s: float, rng: np.random.Generator
) -> Floats:
    """Counts, one detection of all readings after the other."""
    counts = np.zeros(primaries.shape)
    times = np.zeros(primaries.shape)
    with np.errstate(divide="ignore"):
        waits = exposure_time_s / primaries
    going = np.flatnonzero(np.isfinite(waits))
    while going.size:
        times[going] += rng.exponential(waits[going])
        going = going[times[going] < exposure_time_s]
        cascade = rng.geometric(1 - sensor.afterpulse_probability, going.size)
        counts[going] += cascade
        times[going] += cascade * sensor.dead_time_s
    return counts
