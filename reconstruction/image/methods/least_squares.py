"""Least squares under a 1/f prior: the most probable image, if images were Gaussian.

The power of natural images falls with the square of spatial frequency (D. J. Field, J. Opt. Soc.
Am. A 4, 2379 (1987)): so do the variances of the cosines that they consist of.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.dct import DICTIONARY
from ..dictionary import Dictionary
from ..gaussian import Field, GaussianModel, Posterior
from ..grid import Grid, at_most, band
from ..method import Estimate
from ..prior import Prior

MOST = 2**23
"""Numbers in the rows on a grid, at most."""
SEEN = 0.99
"""Share of what the patterns see that a grid holds at least."""


@dataclass(frozen=True)
class LeastSquares:
    """Posterior mean and deviation of Gaussian images, independent in a dictionary's atoms."""

    title = "least squares"
    dictionary: Dictionary = DICTIONARY

    def compile(self, operator: MeasurementOperator) -> "LeastSquaresSolver":
        """Solver of one operator's coefficients: the same for all methods that begin with it."""
        return _compiled(operator, self.dictionary)


@lru_cache(maxsize=2)
def _compiled(operator: MeasurementOperator, dictionary: Dictionary) -> "LeastSquaresSolver":
    return LeastSquaresSolver(operator, dictionary)


class LeastSquaresSolver:
    """Holds what depends on the operator alone.

    ``rows`` (K, n) and ``field`` are those of images on the ``grid``, which has all pixels unless
    that were more than `MOST` numbers.
    """

    def __init__(self, operator: MeasurementOperator, dictionary: Dictionary) -> None:
        self.operator = operator
        prior = Prior(operator, dictionary)
        variance = prior.deviation**2
        self.seen: Floats = prior.atoms.by_atom() * variance
        self.grid = Grid(_sides(self.seen, len(prior.expected)), operator.image_shape)
        height, width = shape = self.grid.shape
        vertical, horizontal = dictionary.atoms(height), dictionary.atoms(width)
        self.field = Field(vertical, horizontal, variance[:height, :width])
        lowest = np.indices(shape).reshape(2, -1)
        spectra = prior.atoms.of((lowest[0], lowest[1]))
        pixels = vertical @ spectra.reshape(len(spectra), *shape) @ horizontal.T
        self.rows: Floats = pixels.reshape(spectra.shape)
        self.model = GaussianModel(self.rows, self.field)
        self._finer_variance: Floats = np.zeros(operator.image_shape)
        if not self.grid.same:
            finer = variance.copy()
            finer[:height, :width] = 0
            tall, wide = (dictionary.atoms(side) for side in operator.image_shape)
            self._finer_variance = Field(tall, wide, finer).pixel_variance
        self._level_image: Floats | None = None
        if operator.level is not None:
            self._level_image = operator.least_energy(
                np.eye(1, operator.shape[0], operator.level)[0]
            )

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """The most probable image."""
        posterior = self.posterior(coefficients)
        if posterior is None:
            return self.flat(coefficients)
        image = self.grid.finer(posterior.mean)
        return self.with_level(image, self.variance(posterior, posterior.variance), coefficients)

    def flat(self, coefficients: Coefficients) -> Estimate:
        """The level alone."""
        return self.with_level(np.zeros(self.operator.image_shape), None, coefficients)

    def posterior(self, coefficients: Coefficients) -> Posterior | None:
        """What coefficients other than the level tell; None where all that are known are 0."""
        measured, noise = self.varying(coefficients)
        return self.model.given(measured, noise) if measured.any() else None

    def variance(self, posterior: Posterior, on_grid: Floats) -> Floats:
        """Variance of pixels (H, W), of that on the grid."""
        if self.grid.same:
            return on_grid
        known = self.grid.finer_density(on_grid) / self.grid.scale**2
        return known + posterior.contrast * self._finer_variance

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


def _sides(seen: Floats, rows: int) -> tuple[int, int]:
    """Sides of the finest grid on which ``rows`` rows are few enough numbers."""
    height, width = seen.shape
    if rows * height * width <= MOST:
        return height, width
    high, wide = band(seen, SEEN)
    room = np.sqrt(MOST / (rows * high * wide))
    return at_most((max(high, int(room * high)), max(wide, int(room * wide))), (height, width))


METHOD = LeastSquares()
