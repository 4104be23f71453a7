"""The linear baseline: the inverse transform with zeros for what was not measured.

Of all images that fit the coefficients this has the least energy; with all N it is exact. It knows
nothing of what was not measured, and so not how far off a pixel is. Directions that patterns tell
worse than others, where patterns are not orthogonal, are shrunk by what their noise exceeds that of
the best by, as in a ridge regression: their inverses would be noise alone. Noise that is a guess
shrinks nothing.
"""

import numpy as np

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..method import Estimate, ImageSolver
from ..noise import CERTAIN
from ..prior import fit_scale


class ZeroFilled:
    """The image of least energy that fits."""

    title = "zero-filled inverse"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of one operator's coefficients."""
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
