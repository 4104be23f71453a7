"""Ways in which detectors stamp the times of single arrivals, at most one in each cycle."""

import math
from typing import Protocol

import numpy as np
from scipy.constants import c
from scipy.ndimage import gaussian_filter1d

from reconstruction.base.arrays import Floats
from spisim.instrument.tof import Reading


class Stamping(Protocol):
    """A way of stamping, with the settings of one instrument."""

    @property
    def piles_up(self) -> bool:
        """Whether the first of many photons ends a cycle, and hides those that come later."""

    @property
    def dead_time_s(self) -> float:
        """How long the detector is blind after a stamp."""

    @property
    def response_sigma_s(self) -> float:
        """Standard deviation of light and time stamp together; nan where it varies."""

    @property
    def reading(self) -> Reading:
        """What one reading collects."""

    def check(self) -> None:
        """Raise InputError where the settings do not fit this way."""

    def chances(self, path_m: Floats, echo_per_s: Floats, steady_per_s: float) -> Floats:
        """Chance (bins,) of a cycle's time stamp in each bin of the gate.

        `echo_per_s` (path bins,) is the rate while the laser is on.
        """

    def sigma_s(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Standard deviation (...) of the delays measured, in closed form."""

    def warnings(self, steady_per_s: float) -> list[str]:
        """Sentences about what steady light does to it."""


def smoothed(path_m: Floats, rate: Floats, sigma_s: float, until_s: float) -> tuple[Floats, Floats]:
    """Even times, and at them the echo to a Gaussian pulse of unit area that is centred on zero.

    `rate` (bins,) is light by path length `path_m`; where its bins are wider than the first, light
    is spread between them. Light too late to show before `until_s` is left out.
    """
    step_m = path_m[1] - path_m[0]
    step = step_m / c
    margin = math.ceil(6 * sigma_s / step)
    last = min(path_m[-1], path_m[0] + step_m * (math.ceil(until_s / step) + margin))
    lengths = path_m[0] + step_m * np.arange(round((last - path_m[0]) / step_m) + 1)
    width = np.gradient(path_m) / step_m
    even = np.interp(lengths, path_m, rate / width)
    padded = np.concatenate([np.zeros(margin), even, np.zeros(margin)])
    smooth = gaussian_filter1d(padded, sigma_s / step, truncate=6.0, mode="constant")
    times = (np.arange(padded.size) - margin) * step + path_m[0] / c
    return times, smooth / step
