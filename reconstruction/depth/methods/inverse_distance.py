"""Baseline interpolation: mean of the spots' ranges, weighted by inverse squared distance.

D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data", Proc. 23rd ACM
National Conference, 517 (1968). Comparison with it shows what the image contributes.
"""

import numpy as np

from ...base.arrays import Floats
from ..between_spots import BetweenSpots

MIN_SQUARED = 1e-6
"""Minimum squared distance from a spot, in pixels."""


def weighted(squared: Floats, range_m: Floats) -> Floats:
    """Inverse-distance-weighted range of K spots in each pixel, (H, W); see `BetweenSpots`."""
    weights = 1 / np.maximum(squared, MIN_SQUARED)
    return np.asarray(weights @ range_m / weights.sum(axis=-1))


METHOD = BetweenSpots("inverse distance", weighted)
