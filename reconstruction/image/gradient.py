"""Differences between neighbouring pixels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def gradient(image: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Differences to the next pixel down and along; 0 at the last."""
    down, along = np.zeros_like(image), np.zeros_like(image)
    np.subtract(image[1:], image[:-1], out=down[:-1])
    np.subtract(image[:, 1:], image[:, :-1], out=along[:, :-1])
    return down, along


def divergence(down: NDArray[Any], along: NDArray[Any]) -> NDArray[Any]:
    """The transpose of `gradient`."""
    total = np.zeros_like(down)
    total[1:] = down[:-1]
    total[:-1] -= down[:-1]
    total[:, 1:] += along[:, :-1]
    total[:, :-1] -= along[:, :-1]
    return total
