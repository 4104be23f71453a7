"""Prior knowledge of the coefficients of an image."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..operators import MeasurementOperator
from .dictionaries.dct import DICTIONARY
from .localised import Localised

RELATIVE, SPREAD = 0.5, 0.8
"""Median of the rms contrast over the mean and standard deviation of its logarithm, for scenes that
tools/drawn_images.py generates for training, in clear air and in fog."""
WHITE = np.logspace(-6, 3, 46)
"""Grid of white parts, relative to the mean variance."""


Sigma = Callable[[tuple[int, int]], Floats]
"""Relative standard deviation of the cosines of images of a shape (H, W), 0 for the constant."""


class Prior:
    """Prior variance of the rows of an operator, DC excluded.

    Images are Gaussian fields of independent cosines, whose standard deviation (H, W) is a function
    ``sigma`` of the image shape. ``varying``: mask of the rows other than DC; ``atoms``: products
    of these rows with the cosines; ``expected``: their variance, up to a common factor.
    """

    def __init__(self, operator: MeasurementOperator, sigma: Sigma = DICTIONARY.sigma) -> None:
        height, width = operator.image_shape
        self._operator = operator
        self.varying = operator.varying
        self.sigma = sigma(operator.image_shape)
        self.atoms = operator.in_atoms(DICTIONARY.atoms(height), DICTIONARY.atoms(width))
        self.expected: Floats = self.atoms.by_row(self.sigma**2)

    @cached_property
    def localised(self) -> Localised:
        """Turn of these rows to differences of blocks."""
        return Localised(self._operator)

    @cached_property
    def _fit(self) -> "VarianceFit":
        return VarianceFit(self.expected)

    def variance(self, coefficients: NDArray[Any], given: Mask | None = None) -> Floats:
        """Prior variance (K,), scaled to ``given`` coefficients; infinite for DC and unmeasured."""
        variance = np.full(coefficients.size, np.inf)
        measured, expected = coefficients[self.varying], self.expected
        if measured.any():
            fit = self._fit
            if given is not None:
                measured = measured[given[self.varying]]
                fit = VarianceFit(expected[given[self.varying]])
            scale, white = fit(measured)
            variance[self.varying] = scale * (expected + white)
        return variance


def usual_contrast(square: float, variance: float) -> float:
    """Median v of images with this squared mean, whose pixels have v times this variance."""
    return RELATIVE**2 * square / variance


class VarianceFit:
    """Maximum-likelihood fit of var(measured) = v (expected + r) to frames, on a grid of r."""

    def __init__(self, expected: Floats) -> None:
        self._white = expected.mean() * WHITE
        shape = expected + self._white[:, None]
        self._weight = 1 / (shape * expected.size)
        self._volume = np.log(shape).sum(axis=1)

    def __call__(self, measured: NDArray[Any]) -> tuple[float, float]:
        """Scale v and white part r, noise and misfit of the spectrum, relative to v."""
        variance = self._weight @ np.abs(measured) ** 2
        best = int(np.argmin(measured.size * np.log(variance) + self._volume))
        return float(variance[best]), float(self._white[best])


def fit_variance(measured: NDArray[Any], expected: Floats) -> tuple[float, float]:
    """Fit var(measured) = v (expected + r) to coefficients (K,) of a frame by maximum likelihood.

    ``expected`` (K,) are relative variances. Returns the scale v, and the white part r relative to
    it.
    """
    return VarianceFit(expected)(measured)


def fit_scale(measured: NDArray[Any], expected: Floats, noise: Floats | float) -> float:
    """Maximum-likelihood scale v in var(measured) = v expected + noise, all variances."""
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
