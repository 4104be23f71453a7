"""Maps of numbers in a page: what is read off below the pointer, and what clouds are made of."""

from base64 import b64encode

import numpy as np
from numpy.typing import ArrayLike

UNKNOWN = 65535
"""Stands for what is not finite; the others are even steps from the lowest value to the highest."""


def packed(values: ArrayLike) -> dict[str, object]:
    """A map (H, W) as 16-bit steps in base64, with the value of the first and that of one step."""
    array = np.asarray(values, dtype=np.float64)
    finite = np.isfinite(array)
    low, high = (array[finite].min(), array[finite].max()) if finite.any() else (0.0, 1.0)
    step = (high - low) / (UNKNOWN - 1) or 1.0
    steps = np.full(array.shape, UNKNOWN, "<u2")
    steps[finite] = np.round((array[finite] - low) / step)
    return {
        "width": array.shape[1],
        "values": b64encode(steps.tobytes()).decode(),
        "low": float(f"{low:.7g}"),
        "step": float(f"{step:.7g}"),
    }
