"""Pixels and those around them."""

import numpy as np

from ..arrays import Floats


def around(image: Floats) -> Floats:
    """Mean of each pixel (H, W) and its eight neighbours; beyond an edge are its own pixels."""
    return _with_next_rows(_with_next_rows(image).T).T


def _with_next_rows(image: Floats) -> Floats:
    above = np.concatenate([image[:1], image[:-1]])
    below = np.concatenate([image[1:], image[-1:]])
    return (above + image + below) / 3


def between(image: Floats, places: Floats) -> Floats:
    """Values (K,) at fractional rows and columns (K, 2), linear between pixels."""
    last = np.array(image.shape) - 1
    within = np.clip(places, 0, last)
    corner = np.minimum(within.astype(int), np.maximum(last - 1, 0))
    beyond = np.minimum(corner + 1, last)
    share = (within - corner).T
    rows = [image[row, corner[:, 1]] for row in (corner[:, 0], beyond[:, 0])]
    next_rows = [image[row, beyond[:, 1]] for row in (corner[:, 0], beyond[:, 0])]
    left, right = ((1 - share[0]) * upper + share[0] * lower for upper, lower in (rows, next_rows))
    return np.asarray((1 - share[1]) * left + share[1] * right)
