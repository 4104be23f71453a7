"""What is known of the coefficients of an image before they are measured."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..operators import MeasurementOperator
from .dictionary import Dictionary


class Prior:
    """How much the rows of an operator, other than the level, vary from image to image.

    ``atoms``: what the rows see of the dictionary; ``deviation`` (H, W) of its coefficients;
    ``expected`` (rows other than the level,): variances up to a common factor.
    """

    def __init__(self, operator: MeasurementOperator, dictionary: Dictionary) -> None:
        height, width = operator.image_shape
        self.varying = operator.varying
        self.deviation = dictionary.deviation(operator.image_shape)
        self.atoms = operator.in_atoms(dictionary.atoms(height), dictionary.atoms(width))
        self.expected: Floats = self.atoms.by_row(self.deviation**2)

    def variance(self, coefficients: NDArray[Any]) -> Floats:
        """Variance (K,) that coefficients (K,) like these have from image to image.

        Infinite for the level, which may be any, and where nothing was measured.
        """
        variance = np.full(coefficients.size, np.inf)
        measured = coefficients[self.varying]
        if measured.any():
            scale, white = fit_variance(measured, self.expected)
            variance[self.varying] = scale * (self.expected + white)
        return variance


def fit_variance(measured: NDArray[Any], expected: Floats) -> tuple[float, float]:
    """Maximum-likelihood fit of var(measured) = v (expected + r): returns v and r.

    ``r`` is the white part, noise and what the expected spectrum misses, relative to v.
    """
    white = expected.mean() * np.logspace(-6, 3, 46)
    shape = expected + white[:, None]
    variance = (np.abs(measured) ** 2 / shape).mean(axis=1)
    cost = measured.size * np.log(variance) + np.log(shape).sum(axis=1)
    best = int(np.argmin(cost))
    return float(variance[best]), float(white[best])


def fit_scale(measured: NDArray[Any], expected: Floats, noise: Floats | float) -> float:
    """Maximum-likelihood fit of var(measured) = v expected + noise, all variances: returns v."""
    power = np.abs(measured) ** 2
    varying = expected > 1e-12 * expected.max(initial=0.0)
    largest = float((power[varying] / expected[varying]).max(initial=0.0)) or 1.0
    scales = largest * np.logspace(-12, 1, 40)
    for finer in (np.logspace(-1 / 3, 1 / 3, 9), np.logspace(-1 / 12, 1 / 12, 7)):
        scales = _likeliest(scales, power, expected, noise) * finer
    return float(_likeliest(scales, power, expected, noise))


def _likeliest(scales: Floats, power: Floats, expected: Floats, noise: Floats | float) -> Any:
    variance = scales[:, None] * expected + noise
    return scales[np.argmin((np.log(variance) + power / variance).sum(axis=1))]
