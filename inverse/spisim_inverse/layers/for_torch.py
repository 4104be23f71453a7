"""Readings and scenes as functions of PyTorch tensors, which gradients go back through.

    pip install 'spisim[torch]'

They run where their tensors are, and are differentiable once.
"""

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from spisim.base.optional import import_optional
from spisim_inverse.layers import display, readings, scene

torch = import_optional("torch", "torch")

Tensor = Any
FUNCTION: Any = torch.autograd.Function


def expected_readings(model: readings.ReadingModel, patterns: Tensor, image: Tensor) -> Tensor:
    """Mean electrons (..., K) of patterns (K, H, W) on transport images (..., H, W).

    Raises
    ------
    InputError
        For other shapes, patterns outside 0..1, and values that are not numbers.
    """
    display.require_shapes(model, patterns, image)
    display.require_values(patterns, image)
    return _expected(model, patterns, image)


def noisy_readings(model: readings.ReadingModel, mean: Tensor, normal: Tensor) -> Tensor:
    """Electrons (..., K) with noise, from `expected_readings` and standard normal numbers."""
    return _noisy(model, mean, normal)


def scene_image(part: scene.SceneImage, changes: Tensor) -> Tensor:
    """Transport image (..., H, W) for changes (..., P) of the parameters of its scene."""
    return _image(part, changes)


def black_and_white(patterns: Tensor) -> Tensor:
    """Patterns of 0 and 1, with the gradient of patterns as they were."""
    return _rounded(None, patterns)


def _differentiable(forward: Callable[..., Any], backward: Callable[..., Any]) -> Any:
    """`forward(part, *tensors)`, with the products `backward(part, *tensors, gradient)`."""

    class Wrapped(FUNCTION):
        @staticmethod
        def forward(context: Any, part: Any, *tensors: Any) -> Any:
            context.part = part
            context.save_for_backward(*tensors)
            return forward(part, *tensors)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(context: Any, gradient: Any) -> Any:
            return None, *backward(context.part, *context.saved_tensors, gradient)

    def applied(part: Any, *tensors: Any) -> Any:
        return Wrapped.apply(_beside(tensors[0], part), *tensors)

    return applied


def _beside(tensor: Any, part: Any) -> Any:
    """A copy of a part of the instrument whose arrays are tensors like this."""
    other = copy(part)
    for name, value in getattr(part, "__dict__", {}).items():
        if isinstance(value, np.ndarray):
            object.__setattr__(other, name, torch.as_tensor(value).to(tensor))
    return other


_expected = _differentiable(readings.expected, readings.expected_vjp)
_noisy = _differentiable(readings.noisy, readings.noisy_vjp)
_image = _differentiable(scene.image_of, scene.image_vjp)
_rounded = _differentiable(display.black_and_white, display.straight_through)
