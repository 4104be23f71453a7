"""Readings and scenes as functions of JAX arrays, which gradients go back through.

    pip install 'spisim[jax]'

They may be compiled and mapped over; inside of that, the values of patterns are not checked.
"""

from collections.abc import Callable
from typing import Any

from spisim.base.optional import import_optional
from spisim_inverse.layers import display, readings, scene

jax = import_optional("jax", "jax")

Array = Any


def expected_readings(model: readings.ReadingModel, patterns: Array, image: Array) -> Array:
    """Mean electrons (..., K) of patterns (K, H, W) on transport images (..., H, W).

    Raises
    ------
    InputError
        For other shapes; outside of compiled functions also for patterns outside 0..1, and values
        that are not numbers.
    """
    display.require_shapes(model, patterns, image)
    if not any(isinstance(each, jax.core.Tracer) for each in (patterns, image)):
        display.require_values(patterns, image)
    return _expected(model)(patterns, image)


def noisy_readings(model: readings.ReadingModel, mean: Array, normal: Array) -> Array:
    """Electrons (..., K) with noise, from `expected_readings` and standard normal numbers."""
    return _noisy(model)(mean, normal)


def scene_image(part: scene.SceneImage, changes: Array) -> Array:
    """Transport image (..., H, W) for changes (..., P) of the parameters of its scene."""
    return _image(part)(changes)


def black_and_white(patterns: Array) -> Array:
    """Patterns of 0 and 1, with the gradient of patterns as they were."""
    return _rounded(None)(patterns)


def _differentiable(forward: Callable[..., Any], backward: Callable[..., Any]) -> Any:
    """Functions of arrays by part of the instrument, with the products of `backward`."""

    def of(part: Any) -> Any:
        @jax.custom_vjp
        def applied(*arrays: Any) -> Any:
            return forward(part, *arrays)

        applied.defvjp(
            lambda *arrays: (forward(part, *arrays), arrays),
            lambda arrays, gradient: backward(part, *arrays, gradient),
        )
        return applied

    return of


_expected = _differentiable(readings.expected, readings.expected_vjp)
_noisy = _differentiable(readings.noisy, readings.noisy_vjp)
_image = _differentiable(scene.image_of, scene.image_vjp)
_rounded = _differentiable(display.black_and_white, display.straight_through)
