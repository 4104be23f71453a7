"""The shape of a pulse in a histogram: a Gaussian, or a measured response."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from ..base.arrays import Floats
from ..capture.readings.dtof import HistogramSpots

GAUSSIAN_REACH = 4.0
"""Standard deviations of a Gaussian pulse beyond which nothing arrives."""
TABLE = 4096
"""Entries of the table of a measured response."""
DIFFERENCE = 0.05
"""Half of the step of a derivative, in widths of the pulse."""
NEGLIGIBLE = 1e-5
"""Fraction of a measured response left out at either end of its core."""


@dataclass(frozen=True, eq=False)
class PulseShape:
    """Fraction of a pulse that has arrived by a time since its delay, in bins.

    ``first`` and ``last`` are the times between which all but a negligible part arrives, ``width``
    the standard deviation of a Gaussian of the same core.
    """

    arrived: Callable[[Floats], Floats]
    first: float
    last: float
    width: float

    def density(self, at: Floats) -> Floats:
        """Rate of arrivals (...) per bin at times since the delay."""
        half = DIFFERENCE * self.width
        return (self.arrived(at + half) - self.arrived(at - half)) / (2 * half)

    def in_bins(self, delay: Floats, bins: Floats) -> Floats:
        """Fractions (..., B) of pulses of these delays (...) in bins (B,), by their lower edges."""
        edges = np.concatenate([bins, bins[-1:] + 1.0])
        return np.asarray(np.diff(self.arrived(edges - np.asarray(delay)[..., None])))


def gaussian_shape(width: float) -> PulseShape:
    """A Gaussian of this standard deviation in bins."""
    reach = GAUSSIAN_REACH * width
    return PulseShape(lambda at: np.asarray(ndtr(at / width)), -reach, reach, width)


def sampled_shape(times: Floats, rates: Floats) -> PulseShape:
    """A response of rates at rising times in bins, linear between, nothing outside."""

    fine = np.linspace(times[0], times[-1], TABLE)
    table = fraction_arrived(times, rates, fine)

    def arrived(at: Floats) -> Floats:
        return np.asarray(np.interp(at, fine, table))

    at = np.interp([NEGLIGIBLE, 0.16, 0.84, 1 - NEGLIGIBLE], table, fine)
    return PulseShape(arrived, float(at[0]), float(at[3]), float(at[2] - at[1]) / 2)


def fraction_arrived(times: Floats, rates: Floats, at: Floats) -> Floats:
    """Fraction (...) that arrives before times ``at``, of rates linear between samples."""
    areas = np.diff(times) * (rates[1:] + rates[:-1]) / 2
    before = np.concatenate([[0.0], np.cumsum(areas)])
    at = np.clip(at, times[0], times[-1])
    row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, times.size - 2)
    since = at - times[row]
    slope = (np.diff(rates) / np.diff(times))[row]
    return np.asarray((before[row] + since * (rates[row] + slope * since / 2)) / before[-1])


def shape_of(spots: HistogramSpots) -> PulseShape | None:
    """Shape that a recording states; None if neither response nor width is known."""
    if spots.response is not None and spots.response_s is not None:
        return sampled_shape(spots.response_s / spots.bin_width_s, spots.response)
    if np.isfinite(spots.response_sigma_s):
        return gaussian_shape(spots.response_sigma_s / spots.bin_width_s)
    return None
