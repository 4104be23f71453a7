"""The linear baseline: the inverse transform with zeros for what was not measured."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..patterns import fwht


def zero_filled(
    shape: tuple[int, int], index: NDArray[np.int32], coefficients: ArrayLike
) -> NDArray[Any]:
    """Inverse Walsh-Hadamard transform of the coefficients (K,) at rows ``index`` (K,): (H, W).

    Of all images that fit the coefficients this has the least energy; with all N it is exact. It is
    complex where they are.
    """
    pixels = shape[0] * shape[1]
    values = np.asarray(coefficients)
    full = np.zeros(pixels, dtype=np.result_type(values, np.float64))
    full[index] = values
    return fwht(full).reshape(shape) / pixels
