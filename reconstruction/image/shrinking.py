"""Each coefficient by itself: for so many of them that their correlations cost too much.

Coefficients c of images vary by v g, g as the prior expects, and are measured with noise of
variance s^2: the best linear estimate of each is v g / (v g + s^2) times what was measured, and
of those that were not measured 0 (N. Wiener, Extrapolation, Interpolation, and Smoothing of
Stationary Time Series, MIT Press 1949). Where most are measured little is lost.
"""

import numpy as np

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients
from .contrast import ContrastByLevel, contrasts, shrunk
from .method import Estimate
from .prior import Prior


class ShrinkingSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator, prior: Prior) -> None:
        self._operator = operator
        self._expected: Floats = prior.expected
        self._everything = float((prior.sigma**2).sum())
        self._expected_contrast = ContrastByLevel(operator, float((prior.sigma**2).mean()))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image, and one standard deviation for all pixels."""
        operator, seen = self._operator, self._operator.varying
        length, pixels = operator.row_length, operator.shape[1]
        finite = np.isfinite(coefficients.noise[seen])
        measured = coefficients.values[seen][finite] / length
        variance = (coefficients.noise[seen][finite] / length) ** 2
        if not measured.any():
            return Estimate(operator.min_norm(coefficients.values))
        expected = self._expected[finite]
        estimated_contrasts = contrasts(
            measured, expected[None], variance, self._expected_contrast(coefficients)
        )
        each = shrunk(estimated_contrasts, expected[None], variance)
        values = coefficients.values.copy()
        values[np.flatnonzero(seen)[finite]] *= each.gain
        left = estimated_contrasts.given[0] * (self._everything - expected.sum())
        left += (each.by_noise + each.between * np.abs(measured) ** 2).sum()
        sigma = np.full(operator.image_shape, np.sqrt(max(left, 0.0) / pixels))
        return Estimate(operator.min_norm(values), sigma)
