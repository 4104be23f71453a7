"""The two-dimensional discrete cosine transform."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idctn

from ...arrays import Floats


class Dct:
    """Cosines, whose power in natural images falls with the square of spatial frequency.

    D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987).
    """

    def atoms(self, side: int) -> Floats:
        """Orthonormal cosines, the lowest frequency first: (side, side)."""
        return np.asarray(dct(np.eye(side), axis=1, norm="ortho"))

    def deviation(self, shape: tuple[int, int]) -> Floats:
        """Inverse to spatial frequency; 0 for the constant image."""
        vertical, horizontal = (np.arange(side) / side for side in shape)
        frequency = np.hypot.outer(vertical, horizontal)
        frequency[0, 0] = np.inf
        return 1 / frequency

    def synthesise(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Image (H, W) of coefficients (H, W)."""
        return np.asarray(idctn(spectrum, norm="ortho"))


DICTIONARY = Dct()
