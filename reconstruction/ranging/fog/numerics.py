"""Batches of small linear systems, and distributions of single numbers."""

import math
from functools import cache

import numpy as np

from ...base.arrays import Floats

RIDGE = 1e-12
"""Added to the diagonal, relative, so that undetermined parameters stay finite."""


def solved(matrix: Floats, vector: Floats) -> Floats:
    """Solutions (C, p) of scaled systems (C, p, p)."""
    scale = _scale(matrix)
    scaled = matrix / (scale[:, :, None] * scale[:, None]) + RIDGE * np.eye(matrix.shape[-1])
    return np.linalg.solve(scaled, (vector / scale)[..., None])[..., 0] / scale


def inverse(matrix: Floats) -> Floats:
    """Inverses of matrices (C, p, p), scaled so that units do not matter."""
    scale = _scale(matrix)
    both = scale[:, :, None] * scale[:, None]
    return np.linalg.inv(matrix / both + RIDGE * np.eye(matrix.shape[-1])) / both


def _scale(matrix: Floats) -> Floats:
    return np.sqrt(np.maximum(np.diagonal(matrix, axis1=1, axis2=2), 1e-100))


def cholesky(covariance: Floats) -> Floats:
    """Lower factors (n, n, C) of many small matrices (C, n, n)."""
    lower = np.ascontiguousarray(covariance.transpose(1, 2, 0))
    for row in range(len(lower)):
        lower[row:, row] /= np.sqrt(lower[row, row])
        for later in range(row + 1, len(lower)):
            lower[later:, later] -= lower[later, row] * lower[later:, row]
    return lower


def whitened(lower: Floats, vectors: Floats) -> Floats:
    """Vectors (n, m, C) whose covariance has these factors, scaled to unit covariance."""
    white = vectors.copy()
    for row in range(len(lower)):
        white[row] /= lower[row, row]
        white[row + 1 :] -= lower[row + 1 :, row, None] * white[row]
    return white


def normal_cdf(sigmas: float) -> float:
    """Normal cumulative distribution; scipy.special takes longer to load than a frame."""
    return math.erfc(-sigmas / math.sqrt(2)) / 2


@cache
def chi_squared_limit(freedom: int, fraction: float) -> float:
    """Value that chi squared of so many degrees of freedom exceeds with this probability."""
    below, above = 0.0, float(freedom)
    while chi_squared_above(above, freedom) > fraction:
        above *= 2
    while above - below > 1e-12 * above:
        middle = (below + above) / 2
        if chi_squared_above(middle, freedom) > fraction:
            below = middle
        else:
            above = middle
    return above


def chi_squared_above(value: float, freedom: int) -> float:
    """Survival function, a finite series (Abramowitz & Stegun 1964, 26.4.4 and 26.4.5)."""
    odd = freedom % 2
    term = math.sqrt(2 * value / math.pi) * math.exp(-value / 2) if odd else math.exp(-value / 2)
    total = math.erfc(math.sqrt(value / 2)) if odd else 0.0
    for degree in range(2 + odd, freedom + 1, 2):
        total += term
        term *= value / degree
    return total
