"""Wiener filter of each coefficient: for operators too large to account for correlations.

Coefficients of images have variances v g, with g from the prior, and noise of variance s^2: the
best linear estimate of each is v g / (v g + s^2) times its measurement, and 0 if unmeasured (N.
Wiener, Extrapolation, Interpolation, and Smoothing of Stationary Time Series, MIT Press 1949). If
most are measured, little is lost.
"""

import numpy as np

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients
from .contrast import ContrastByDc, contrasts, shrunk
from .method import Estimate
from .prior import Prior


class ShrinkingSolver:
    """Solver with all that depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator, prior: Prior) -> None:
        self._operator = operator
        self._expected: Floats = prior.expected
        self._everything = float((prior.sigma**2).sum())
        self._expected_contrast = ContrastByDc(operator, float((prior.sigma**2).mean()))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Image, with one standard deviation for all pixels."""
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
