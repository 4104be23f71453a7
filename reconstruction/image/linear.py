"""The linear baseline: the inverse transform with zeros for what was not measured."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..patterns import fwht


def zero_filled(
    shape: tuple[int, int], index: NDArray[np.int32], coefficients: ArrayLike
) -> NDArray[np.float64]:
    """Inverse Walsh-Hadamard transform of the coefficients (K,) at rows ``index`` (K,): (H, W).

    Of all images that fit the coefficients this has the least energy; with all N it is exact.
    """
    pixels = shape[0] * shape[1]
    full = np.zeros(pixels)
    full[index] = coefficients
    return fwht(full).reshape(shape) / pixels
