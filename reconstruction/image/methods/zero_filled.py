"""The linear baseline: the inverse transform with zeros for what was not measured.

Of all images that fit the coefficients this has the least energy; with all N it is exact.
"""

from typing import Any

from numpy.typing import NDArray

from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..method import ImageSolver


class ZeroFilled:
    """The image of least energy that fits."""

    title = "zero-filled inverse"

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of one operator's coefficients."""

        def solve(coefficients: Coefficients) -> NDArray[Any]:
            return operator.least_energy(coefficients.values)

        return solve


METHOD = ZeroFilled()
