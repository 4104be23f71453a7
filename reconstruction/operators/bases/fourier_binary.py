"""Fourier patterns for binary displays: cosines dithered to black and white."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..basis import Basis
from .fourier import Fourier

#: Weights of a pixel's error, R. W. Floyd and L. Steinberg, Proc. Soc. Inf. Disp. 17, 75 (1976).
AHEAD, BELOW_BEHIND, BELOW, BELOW_AHEAD = 7 / 16, 3 / 16, 5 / 16, 1 / 16


class FourierBinary(Fourier):
    """Rows of `Fourier`, dithered to -1 and 1 by error diffusion.

    Z. Zhang et al., Sci. Rep. 7, 12029 (2017), dither on a display with more pixels than the image.
    Here the plan has the display's pixels and exposes only the lowest frequencies. The decoder uses
    the dithered patterns themselves, not the cosines that they approximate.
    """

    name = "fourier-binary"

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        return _dithered(self.shape, index.astype(np.int32).tobytes()).astype(np.float64)


@lru_cache(maxsize=2)
def _dithered(shape: tuple[int, int], index: bytes) -> NDArray[np.int8]:
    """Binary rows (K, N), cached because a plan asks for the same ones repeatedly."""
    grey = Fourier(shape).matrix(np.frombuffer(index, np.int32)).reshape(-1, *shape)
    return diffused(grey).reshape(len(grey), -1)


def diffused(grey: Floats) -> NDArray[np.int8]:
    """Dither images (K, H, W) of -1..1 to -1 and 1, line by line from the top left."""
    count, height, width = grey.shape
    left = np.zeros((height + 1, width + 2, count))  # padding absorbs errors at the edges
    left[:height, 1:-1] = np.moveaxis(grey, 0, -1)
    binary = np.empty((height, width, count), np.int8)
    for y in range(height):
        for x in range(width):
            value = left[y, x + 1]
            binary[y, x] = np.where(value >= 0, 1, -1)
            error = value - binary[y, x]
            left[y, x + 2] += AHEAD * error
            left[y + 1, x] += BELOW_BEHIND * error
            left[y + 1, x + 1] += BELOW * error
            left[y + 1, x + 2] += BELOW_AHEAD * error
    return np.moveaxis(binary, -1, 0)


BASIS: type[Basis] = FourierBinary
