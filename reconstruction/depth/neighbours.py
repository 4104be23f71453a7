"""Pixels and those around them."""

import numpy as np

from ..base.arrays import Floats


def around(image: Floats) -> Floats:
    """Mean of each pixel (H, W) and its eight neighbours; beyond an edge are its own pixels."""
    return _with_next_rows(_with_next_rows(image).T).T / 9


def _with_next_rows(image: Floats) -> Floats:
    total = image.astype(np.float64)
    total[1:] += image[:-1]
    total[:-1] += image[1:]
    total[0] += image[0]
    total[-1] += image[-1]
    return total


def between(image: Floats, positions: Floats) -> Floats:
    """Values (K,) at fractional rows and columns (K, 2), linear between pixels."""
    down, along = (
        hats(position, side) for position, side in zip(positions.T, image.shape, strict=True)
    )
    return np.asarray(((down @ image) * along).sum(axis=1))


def hats(positions: Floats, side: int) -> Floats:
    """What each pixel along an axis counts at fractional places (K,) on it: (K, side)."""
    within = np.clip(positions, 0, side - 1)
    return np.maximum(1 - np.abs(within[:, None] - np.arange(side)), 0)


def wide_hats(positions: Floats, side: int) -> Floats:
    """The same for the mean with the neighbours along this axis."""
    return np.asarray(_with_next_rows(hats(positions, side).T).T / 3)
