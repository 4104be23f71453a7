"""Which multiple of the unambiguous range a spot's range lacks, by the strength of its echo.

A surface beyond the unambiguous range R seems to lie at r instead of r + k R, and therefore to be
darker than any: the reflectance that its echo states is too small by (r / (r + k R))², and in fog
by exp(-2 alpha k R) more. The motion of the drone cannot tell: what is seen at r moves like what is
there. The depth map of the frame has its say, but not the last word, as it rests on the same
ranges.
"""

from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats

LOG_REFLECTANCE, SPREAD = -1.2, 0.9
"""Mean and standard deviation of the logarithm of reflectance times the cosine of incidence."""
MULTIPLES = np.arange(3)[:, None]
LOG_PRIOR = np.log(0.1)
"""Of each multiple relative to the one before: most of what is met is near."""
MAX_SIGMAS = 4.0
"""Deviation from the map beyond which it speaks no louder."""
MIN_PROBABILITY = 0.8
"""Of the multiple that is taken; with less, there is no range."""


class Expected(NamedTuple):
    """What is expected of ranges (S,): their logarithm by the depth map, and its sigma."""

    log_range: Floats
    sigma: Floats


def unwrapped(
    range_m: Floats,
    log_reflectance: Floats,
    max_range_m: float,
    expected: Expected,
    extinction_per_m: float = 0.0,
) -> Floats:
    """Ranges (S,) with the likeliest multiple of ``max_range_m``, nan where none is likely enough.

    ``log_reflectance`` (S,) is that of a facing surface at ``range_m``, nan if unknown: then the
    range stays as it is.
    """
    farther_m = MULTIPLES * max_range_m
    possible_m = range_m + farther_m
    log = log_reflectance + 2 * np.log(possible_m / range_m) + 2 * extinction_per_m * farther_m
    off = np.abs(np.log(possible_m) - expected.log_range) / expected.sigma
    evidence = MULTIPLES * LOG_PRIOR - 0.5 * ((log - LOG_REFLECTANCE) / SPREAD) ** 2
    evidence -= 0.5 * np.minimum(off, MAX_SIGMAS) ** 2
    weights = np.exp(evidence - evidence.max(axis=0))
    weights /= weights.sum(axis=0)
    best = weights.argmax(axis=0)
    spot = np.arange(len(range_m))
    result = np.where(weights[best, spot] >= MIN_PROBABILITY, possible_m[best, spot], np.nan)
    return np.where(np.isfinite(log_reflectance), result, range_m)
