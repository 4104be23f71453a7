"""Many small linear systems at once, scaled so that their units do not matter."""

import numpy as np

from ...base.arrays import Floats

RIDGE = 1e-12
"""Relative to the diagonal: what no reading tells stays finite."""


def solved(matrix: Floats, vector: Floats) -> Floats:
    """Solutions (C, p) of systems (C, p, p)."""
    scale = _scale(matrix)
    scaled = matrix / (scale[:, :, None] * scale[:, None]) + RIDGE * np.eye(matrix.shape[-1])
    return np.linalg.solve(scaled, (vector / scale)[..., None])[..., 0] / scale


def inverse(matrix: Floats) -> Floats:
    """Inverses of matrices (C, p, p)."""
    scale = _scale(matrix)
    both = scale[:, :, None] * scale[:, None]
    return np.linalg.inv(matrix / both + RIDGE * np.eye(matrix.shape[-1])) / both


def _scale(matrix: Floats) -> Floats:
    return np.sqrt(np.maximum(np.diagonal(matrix, axis1=1, axis2=2), 1e-100))
