"""Linear baseline: the inverse transform with zeros for unmeasured coefficients.

It is the minimum-norm image that fits the coefficients, exact with all N of them. It gives no
standard deviation, as it knows nothing of what was not measured. If the patterns are not
orthogonal, directions with more noise than the best are shrunk by the excess, as in ridge
regression: their inverses would be noise alone. Uncertain noise shrinks nothing.
"""

import numpy as np

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..method import Estimate, ImageSolver
from ..noise import CERTAIN
from ..prior import fit_scale


class ZeroFilled:
    """Minimum-norm image that fits the coefficients."""

    title = "zero-filled inverse"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        varying, usual = operator.varying, operator.usual_noise
        worse = usual**2 - usual[varying].min(initial=np.inf) ** 2
        if not worse[varying].any():
            return lambda coefficients: Estimate(operator.min_norm(coefficients.values))
        equal = np.ones(np.count_nonzero(varying))

        def solve(coefficients: Coefficients) -> Estimate:
            if coefficients.levels is not CERTAIN:
                return Estimate(operator.min_norm(coefficients.values))
            valid = varying & coefficients.measured
            values, excess = coefficients.values.copy(), np.zeros(varying.size)
            excess[valid] = coefficients.noise[valid] ** 2 * (worse / usual**2)[valid]
            power = fit_scale(values[valid], equal[: valid.sum()], excess[valid])
            values[valid] *= power / (power + excess[valid])
            return Estimate(operator.min_norm(values))

        return solve


METHOD = ZeroFilled()
