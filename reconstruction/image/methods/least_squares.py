"""Least squares under a 1/f prior: the most probable image, if images were Gaussian.

The power of natural images falls with the square of spatial frequency (D. J. Field, J. Opt. Soc.
Am. A 4, 2379 (1987)): so do the variances of the cosines that they consist of.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.dct import DICTIONARY
from ..dictionary import Dictionary
from ..gaussian import Field, GaussianModel, Posterior
from ..method import Estimate


@dataclass(frozen=True)
class LeastSquares:
    """Posterior mean and deviation of Gaussian images, independent in a dictionary's atoms."""

    title = "least squares"
    dictionary: Dictionary = DICTIONARY

    def compile(self, operator: MeasurementOperator) -> "LeastSquaresSolver":
        """Solver of one operator's coefficients."""
        return LeastSquaresSolver(operator, self.dictionary)


class LeastSquaresSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator, dictionary: Dictionary) -> None:
        height, width = operator.image_shape
        self.operator = operator
        self.field = Field(
            dictionary.atoms(height),
            dictionary.atoms(width),
            dictionary.deviation(operator.image_shape) ** 2,
        )
        units = np.eye(operator.shape[0])
        self._level_image: Floats | None = None
        if operator.level is not None:
            self._level_image = operator.least_energy(units[operator.level])
        rows = operator.back_project(units[operator.varying]) / operator.row_length
        self.rows: Floats = rows.reshape(len(rows), -1)
        self.model = GaussianModel(self.rows, self.field)

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The most probable image."""
        posterior = self.posterior(coefficients)
        if posterior is None:
            return self.with_level(np.zeros(self.operator.image_shape), None, coefficients)
        return self.with_level(posterior.mean, posterior.variance, coefficients)

    def posterior(self, coefficients: Coefficients) -> Posterior | None:
        """What coefficients other than the level tell; None where all that are known are 0."""
        measured, noise = self.varying(coefficients)
        return self.model.given(measured, noise) if measured.any() else None

    def varying(self, coefficients: Coefficients) -> tuple[NDArray[Any], Floats]:
        """Coefficients other than the level, of rows of length 1, and their noise."""
        varying, length = self.operator.varying, self.operator.row_length
        return coefficients.values[varying] / length, coefficients.noise[varying] / length

    def with_level(
        self, image: NDArray[Any], variance: Floats | None, coefficients: Coefficients
    ) -> Estimate:
        """The estimate of an image (H, W) that has no level yet, and of its variance."""
        level = self.operator.level
        if self._level_image is None or level is None or not coefficients.measured[level]:
            return Estimate(image, None if variance is None else np.sqrt(variance))
        image = image + coefficients.values[level] * self._level_image
        if variance is None:
            return Estimate(image)
        error = coefficients.noise[level] * self._level_image
        return Estimate(image, np.sqrt(variance + error**2))


METHOD = LeastSquares()
