"""The two-dimensional discrete cosine transform."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats


class Dct:
    """Cosines, whose power in natural images falls with the square of spatial frequency.

    D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987).
    """

    def atoms(self, side: int) -> Floats:
        """Orthonormal cosines, the lowest frequency first: (side, side)."""
        return _cosines(side)

    def deviation(self, shape: tuple[int, int]) -> Floats:
        """Inverse to spatial frequency; 0 for the constant image."""
        vertical, horizontal = (np.arange(side) / side for side in shape)
        frequency = np.hypot.outer(vertical, horizontal)
        frequency[0, 0] = np.inf
        return 1 / frequency

    def synthesise(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Image (H, W) of coefficients (H, W)."""
        height, width = spectrum.shape
        return np.asarray(_cosines(height) @ spectrum @ _cosines(width).T)


@lru_cache(maxsize=8)
def _cosines(side: int) -> Floats:
    at = (2 * np.arange(side) + 1) * np.pi / (2 * side)
    cosines = np.sqrt(2 / side) * np.cos(np.outer(at, np.arange(side)))
    cosines[:, 0] = np.sqrt(1 / side)
    cosines.setflags(write=False)
    return cosines


DICTIONARY = Dct()
