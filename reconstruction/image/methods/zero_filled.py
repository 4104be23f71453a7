"""The linear baseline: the inverse transform with zeros for what was not measured.

Of all images that fit the coefficients this has the least energy; with all N it is exact. It knows
nothing of what was not measured, and so not how far off a pixel is.
"""

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..method import Estimate, ImageSolver


class ZeroFilled:
    """The image of least energy that fits."""

    title = "zero-filled inverse"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of one operator's coefficients."""

        def solve(coefficients: Coefficients) -> Estimate:
            return Estimate(operator.least_energy(coefficients.values))

        return solve


METHOD = ZeroFilled()
