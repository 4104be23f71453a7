"""Echoes to pulses that are not infinitely short."""

import math

import numpy as np
from scipy.constants import c
from scipy.ndimage import gaussian_filter1d

from reconstruction.arrays import Floats


def smoothed(path_m: Floats, rate: Floats, sigma_s: float) -> tuple[Floats, Floats]:
    """Times, and at them the echo to a Gaussian pulse of unit area that is centred on zero."""
    step = (path_m[1] - path_m[0]) / c
    margin = math.ceil(6 * sigma_s / step)
    padded = np.concatenate([np.zeros(margin), rate, np.zeros(margin)])
    smooth = gaussian_filter1d(padded, sigma_s / step, truncate=6.0, mode="constant")
    times = (np.arange(padded.size) - margin) * step + path_m[0] / c
    return times, smooth / step
