"""The usual interpolation: the mean of the spots' ranges, weighted by inverse squared distance.

D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data", Proc. 23rd ACM
National Conference, 517 (1968). It knows nothing of the image: what a method that does is worth is
told by comparison.
"""

import numpy as np

from ...base.arrays import Floats
from ..between_spots import BetweenSpots

MIN_SQUARED = 1e-6
"""Squared distance in pixels that a pixel has from a spot, at least."""


def weighted(squared: Floats, range_m: Floats) -> Floats:
    """Mean range of K spots in each pixel, (H, W), the nearer the more; see `BetweenSpots`."""
    weights = 1 / np.maximum(squared, MIN_SQUARED)
    return np.asarray(weights @ range_m / weights.sum(axis=-1))


METHOD = BetweenSpots("inverse distance", weighted)
