"""Coarser grids for images whose finest details were not measured."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .dictionaries.dct import DICTIONARY

Shape = tuple[int, int]


class Grid:
    """Images of the lowest ``shape`` (h, w) frequencies; `finer` divides values by `scale`."""

    def __init__(self, shape: Shape, finer: Shape) -> None:
        self.shape = shape
        self.scale = float(np.sqrt(finer[0] * finer[1] / (shape[0] * shape[1])))
        self._down, self._across = (
            DICTIONARY.atoms(side)[:, :fewer] @ DICTIONARY.atoms(fewer).T
            for side, fewer in zip(finer, shape, strict=True)
        )

    def finer(self, image: NDArray[Any]) -> NDArray[Any]:
        """An image (h, w) on the finer grid."""
        return np.asarray(self._down @ image @ self._across.T)

    def finer_density(self, image: Floats) -> Floats:
        """A relative variance per pixel, interpolated on the finer grid."""
        return np.maximum(self.scale * self.finer(image), 0)


def band(seen: Floats, fraction: float) -> Shape:
    """Lowest frequencies that contain a fraction of the total of ``seen`` (H, W)."""
    rows, columns = (
        int(np.searchsorted(np.cumsum(seen.sum(axis=1 - axis)), fraction * seen.sum())) + 1
        for axis in (0, 1)
    )
    return min(rows, seen.shape[0]), min(columns, seen.shape[1])


def at_most(shape: Shape, limit: Shape) -> Shape:
    """Shape with no side longer than the limit's."""
    return min(shape[0], limit[0]), min(shape[1], limit[1])
