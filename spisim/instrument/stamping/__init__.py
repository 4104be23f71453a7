"""Time stamps of single arrivals, by first photons or by a threshold."""

import math

import numpy as np
from scipy.constants import c
from scipy.ndimage import gaussian_filter1d

from reconstruction.base.arrays import Floats
from spisim.instrument.response import Response


def smoothed(
    path_m: Floats, rate: Floats, pulse: float | Response, until_s: float
) -> tuple[Floats, Floats]:
    """Uniform times, and the echo at them of a pulse of unit area.

    `pulse` is the standard deviation, s, of a Gaussian centred on zero, or a measured response.
    `rate` (bins,) is light by path length `path_m`; bins wider than the first are spread out. Light
    too late to matter before `until_s` is left out.
    """
    step_m = path_m[1] - path_m[0]
    step = step_m / c
    reach_s = pulse.reach_s if isinstance(pulse, Response) else 6 * pulse
    margin = math.ceil(reach_s / step)
    last = min(path_m[-1], path_m[0] + step_m * (math.ceil(until_s / step) + margin))
    lengths = path_m[0] + step_m * np.arange(round((last - path_m[0]) / step_m) + 1)
    width = np.gradient(path_m) / step_m
    even = np.interp(lengths, path_m, rate / width)
    padded = np.concatenate([np.zeros(margin), even, np.zeros(margin)])
    if isinstance(pulse, Response):
        smooth = pulse.applied(padded, step)
    else:
        smooth = gaussian_filter1d(padded, pulse / step, truncate=6.0, mode="constant")
    times = (np.arange(padded.size) - margin) * step + path_m[0] / c
    return times, smooth / step
