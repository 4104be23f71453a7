"""Baseline: each pixel takes the range of the nearest spot that has one."""

import numpy as np

from ...base.arrays import Floats
from ..between_spots import BetweenSpots


def nearest(squared: Floats, range_m: Floats) -> Floats:
    """Range of the nearest of K spots in each pixel, (H, W); see `BetweenSpots`."""
    return range_m[np.argmin(squared, axis=-1)]


METHOD = BetweenSpots("nearest spot", nearest)
