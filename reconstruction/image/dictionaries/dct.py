"""The two-dimensional discrete cosine transform."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ...base.arrays import Floats
from ..dictionary import Band


class Dct:
    """Cosines with 1/f amplitudes: D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987)."""

    def bands(self, shape: tuple[int, int]) -> Sequence[Band]:
        """All cosines in one band."""
        vertical, horizontal = (_cosines(side) for side in shape)
        return [Band(vertical, horizontal, self.sigma(shape))]

    def atoms(self, side: int) -> Floats:
        """Orthonormal cosines (side, side) in columns, lowest frequency first."""
        return _cosines(side)

    def sigma(self, shape: tuple[int, int]) -> Floats:
        """Standard deviation inverse to spatial frequency; 0 for the constant image."""
        vertical, horizontal = (np.arange(side) / side for side in shape)
        frequency = np.hypot.outer(vertical, horizontal)
        frequency[0, 0] = np.inf
        return 1 / frequency

    def band(self, vertical: Floats, horizontal: Floats) -> Band:
        """Band of other atoms (H, a) and (W, b), with the variances that cosines imply."""
        tall, wide = (_cosines(len(atoms)).T @ atoms for atoms in (vertical, horizontal))
        power = self.sigma((len(vertical), len(horizontal))) ** 2
        return Band(vertical, horizontal, np.sqrt(tall.T**2 @ power @ wide**2))


@lru_cache(maxsize=8)
def _cosines(side: int) -> Floats:
    at = (2 * np.arange(side) + 1) * np.pi / (2 * side)
    cosines = np.sqrt(2 / side) * np.cos(np.outer(at, np.arange(side)))
    cosines[:, 0] = np.sqrt(1 / side)
    cosines.setflags(write=False)
    return cosines


DICTIONARY = Dct()
