"""What a projector can display, and what readings can be made of."""

from typing import Any

import numpy as np

from reconstruction.base.errors import InputError
from spisim_inverse.layers.readings import ReadingModel

Array = Any
"""An array of NumPy, PyTorch or JAX."""


def require_shapes(model: ReadingModel, patterns: Array, image: Array) -> None:
    """Raise InputError unless patterns (K, H, W) and image (..., H, W) fit the model."""
    height, width = model.electrons.shape
    if patterns.ndim != 3 or tuple(patterns.shape[1:]) != (height, width) or not len(patterns):
        raise InputError(
            f"patterns of shape {tuple(patterns.shape)}: must be (patterns, {height}, {width}), "
            "at least one"
        )
    if image.ndim < 2 or tuple(image.shape[-2:]) != (height, width):
        raise InputError(
            f"image of shape {tuple(image.shape)}: must end in ({height}, {width}), the "
            "instrument's pixels"
        )


def require_values(patterns: Array, image: Array) -> None:
    """Raise InputError unless patterns lie in 0..1 and the image is of finite numbers."""
    _require(patterns, (patterns >= 0) & (patterns <= 1), "patterns", "transmittances from 0 to 1")
    _require(image, abs(image) < np.inf, "image", "finite numbers")


def _require(values: Array, good: Array, name: str, allowed: str) -> None:
    if not bool(good.all()):
        flat = good.reshape(-1)
        first = int((flat * 1).argmin())
        index = [int(n) for n in np.unravel_index(first, tuple(values.shape))]
        raise InputError(
            f"{name}: the value at {index} is {float(values.reshape(-1)[first]):g}; allowed are "
            f"{allowed} (indices count from 0)"
        )


def black_and_white(_: None, patterns: Array) -> Array:
    """Patterns (K, H, W) of 0 and 1: 1 from a half on."""
    return 0 * patterns + (patterns >= 0.5)


def straight_through(_: None, patterns: Array, gradient: Array) -> tuple[Array]:
    """The gradient as if nothing had been rounded: Y. Bengio et al., arXiv:1308.3432 (2013)."""
    return (gradient,)
