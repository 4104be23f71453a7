"""Whether a depth map agrees with ranges of the spots: a predictive check."""

import numpy as np

from ..base.arrays import Floats, Mask
from .method import MAX_RANGE_M, DepthEstimate
from .pixels import around, between

MIN_SIGMA = 0.15
MAX_SIGMA = 0.25
"""Bounds of the sigma of ln depth at a spot's pixel: a map is to hold there what the spot measures,
however sure it is elsewhere."""
MAX_AWAY = 4.0
"""Deviation beyond which a single spot speaks no louder, as on an edge."""
AGREE = 2.0
"""Maximum rms deviation of the spots from a map that agrees with them, in its sigmas."""


def agrees(estimate: DepthEstimate, pixel: Floats, log_depth: Floats) -> Mask:
    """Whether a map agrees with some depths of the spots, (L,).

    Parameters
    ----------
    estimate
        The map; what has no return lies at the maximum range.
    pixel : array, (S, 2)
        Rows and columns of the spots.
    log_depth : array, (L, S)
        Logarithms of L possible depths of all spots, not finite where there is none. Where no spot
        has any, the map agrees.
    """
    known = np.isfinite(estimate.depth_m)
    of_map = between(around(np.log(np.where(known, estimate.depth_m, MAX_RANGE_M))), pixel)
    sigma = np.zeros(known.shape) if estimate.sigma is None else estimate.sigma
    of_sigma = between(np.where(np.isfinite(sigma), sigma, 0.0), pixel)
    usable = np.isfinite(log_depth)
    away = np.where(usable, log_depth - of_map, 0) / np.clip(of_sigma, MIN_SIGMA, MAX_SIGMA)
    squares = (np.minimum(np.abs(away), MAX_AWAY) ** 2).sum(axis=1)
    return np.asarray(squares <= AGREE**2 * usable.sum(axis=1))
