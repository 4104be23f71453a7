"""Pixels and those around them."""

import numpy as np

from ..arrays import Floats


def around(image: Floats) -> Floats:
    """Mean of each pixel (H, W) and its eight neighbours; beyond an edge are its own pixels."""
    for axis in (0, 1):
        padded = np.pad(image, [(1, 1) if each == axis else (0, 0) for each in (0, 1)], "edge")
        before, at, after = (
            padded.take(range(start, start + image.shape[axis]), axis) for start in range(3)
        )
        image = (before + at + after) / 3
    return image


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
