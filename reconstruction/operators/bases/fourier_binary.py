"""Fourier patterns for displays that are on or off: cosines dithered to black and white."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..basis import Basis
from .fourier import Fourier

#: Shares of a pixel's error, R. W. Floyd and L. Steinberg, Proc. Soc. Inf. Disp. 17, 75 (1976).
AHEAD, BELOW_BEHIND, BELOW, BELOW_AHEAD = 7 / 16, 3 / 16, 5 / 16, 1 / 16


class FourierBinary(Fourier):
    """Rows of `Fourier` with values of -1 and 1 alone, by error diffusion.

    Z. Zhang et al., Sci. Rep. 7, 12029 (2017), who show them on a finer display than the image that
    is wanted: here, a projector of as many more pixels, of whose frequencies the lowest are shown.
    What is decoded are these very patterns, dots and all, and not the cosines that they stand for.
    """

    name = "fourier-binary"

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        """The rows ``index`` (K,), (K, N)."""
        return _dithered(self.shape, index.astype(np.int32).tobytes()).astype(np.float64)


@lru_cache(maxsize=2)
def _dithered(shape: tuple[int, int], index: bytes) -> NDArray[np.int8]:
    """Rows (K, N) in black and white; a plan asks for the same ones again and again."""
    grey = Fourier(shape).matrix(np.frombuffer(index, np.int32)).reshape(-1, *shape)
    return diffused(grey).reshape(len(grey), -1)


def diffused(grey: Floats) -> NDArray[np.int8]:
    """Images (K, H, W) of -1 to 1 in -1 and 1; lines from the left, the first one first."""
    count, height, width = grey.shape
    left = np.zeros((height + 1, width + 2, count))  # padded, so that errors leave at the edges
    left[:height, 1:-1] = np.moveaxis(grey, 0, -1)
    displayed = np.empty((height, width, count), np.int8)
    for y in range(height):
        for x in range(width):
            value = left[y, x + 1]
            displayed[y, x] = np.where(value >= 0, 1, -1)
            error = value - displayed[y, x]
            left[y, x + 2] += AHEAD * error
            left[y + 1, x] += BELOW_BEHIND * error
            left[y + 1, x + 1] += BELOW * error
            left[y + 1, x + 2] += BELOW_AHEAD * error
    return np.moveaxis(displayed, -1, 0)


BASIS: type[Basis] = FourierBinary
