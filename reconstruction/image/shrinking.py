"""Each coefficient by itself: for so many of them that their correlations cost too much.

Coefficients c of images vary by v g, g as the prior expects, and are measured with noise of
variance s^2: the best linear estimate of each is v g / (v g + s^2) times what was measured, and
of those that were not measured 0 (N. Wiener, Extrapolation, Interpolation, and Smoothing of
Stationary Time Series, MIT Press 1949). Where most are measured little is lost.
"""

import numpy as np

from ..arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients
from .method import Estimate
from .prior import Prior, fit_scale


class ShrinkingSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator, prior: Prior) -> None:
        self._operator = operator
        self._expected: Floats = prior.expected
        self._everything = float((prior.deviation**2).sum())

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The image, and one standard deviation for all pixels."""
        operator, seen = self._operator, self._operator.varying
        length, pixels = operator.row_length, operator.shape[1]
        known = np.isfinite(coefficients.noise[seen])
        measured = coefficients.values[seen][known] / length
        variance = (coefficients.noise[seen][known] / length) ** 2
        if not measured.any():
            return Estimate(operator.least_energy(coefficients.values))
        expected = self._expected[known]
        scale = fit_scale(measured, expected, variance)
        kept = scale * expected / (scale * expected + variance)
        values = coefficients.values.copy()
        values[np.flatnonzero(seen)[known]] *= kept
        left = scale * (self._everything - expected.sum()) + (kept * variance).sum()
        deviation = np.full(operator.image_shape, np.sqrt(max(left, 0.0) / pixels))
        return Estimate(operator.least_energy(values), deviation)
