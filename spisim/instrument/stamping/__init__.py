"""Time stamps of single arrivals, by first photons or by a threshold."""

import math

import numpy as np
from scipy.constants import c
from scipy.ndimage import gaussian_filter1d

from reconstruction.base.arrays import Floats


def smoothed(path_m: Floats, rate: Floats, sigma_s: float, until_s: float) -> tuple[Floats, Floats]:
    """Uniform times, and the echo at them of a Gaussian pulse of unit area centred on zero.

    `rate` (bins,) is light by path length `path_m`; bins wider than the first are spread out. Light
    too late to matter before `until_s` is left out.
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
