"""Depth maps against the truth: what is estimated where the true depth is so much."""

from collections.abc import Mapping, Sequence

import numpy as np

from reconstruction import Result
from reconstruction.capture import Truth

#: Bins of true depth, each 19 % wider than the one before.
EDGES_M = np.geomspace(0.5, 32.0, 25)
CENTRES_M = np.sqrt(EDGES_M[:-1] * EDGES_M[1:])
#: Fewer pixels in a bin tell nothing.
MIN_PIXELS = 5

#: Mean estimated depth in each bin, None where there are too few pixels, by method.
Profile = Mapping[str, Sequence[float | None]]


def depth_profile(results: Sequence[Result], truth: Truth) -> Profile:
    """Mean estimated depth by true depth, over the pixels of all frames."""
    profiles = {}
    for method in dict.fromkeys(method for result in results for method in result.depths):
        having = [result for result in results if method in result.depths]
        true_m = np.array([truth.at(result.frame).depth_m for result in having])
        profiles[method] = _means(true_m, np.array([result.depths[method] for result in having]))
    return profiles


def _means(true_m: np.ndarray, estimated_m: np.ndarray) -> list[float | None]:
    both = np.isfinite(true_m) & np.isfinite(estimated_m)
    if not both.any():
        return [None] * CENTRES_M.size
    x, y = true_m[both].astype(float), estimated_m[both].astype(float)
    count, _ = np.histogram(x, EDGES_M)
    total, _ = np.histogram(x, EDGES_M, weights=y)
    return [float(s / n) if n >= MIN_PIXELS else None for s, n in zip(total, count, strict=True)]
