"""Gaussian images, given coefficients with non-uniform noise."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from ..base.arrays import Floats
from .contrast import contrasts
from .posterior import Field, Posterior

BLOCK = 4
"""Side of the blocks of pixels represented by one pixel."""


class Factorised(Posterior):
    """Posterior of one frame by Cholesky factorisation; see `gaussian` for R and C."""

    def __init__(
        self,
        measured: NDArray[Any],
        noise: Floats,
        rows: Floats,
        gram: Floats,
        seen: Floats,
        field: Field,
        expected: float | None,
    ) -> None:
        finite = np.isfinite(noise)
        gram = gram[np.ix_(finite, finite)]
        variance = noise[finite] ** 2
        self.noise = noise
        self.contrast = contrasts(measured[finite], np.diag(gram)[None], variance, expected).given[
            0
        ]
        shrinking = self.contrast / (self.contrast * np.diag(gram) + variance)
        self.noise_energy = float((shrinking**2 * np.diag(gram) * variance).sum())
        matrix = self.contrast * gram
        matrix[np.diag_indices_from(matrix)] += variance
        self._factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
        self._measured, self._seen, self._field = finite, seen, field
        self._rows = rows[finite]
        self._prior = self.contrast * field.variance
        self.mean = self._prior * self._spread(self._solved(measured[finite]))

    @property
    def own_mean(self) -> NDArray[Any]:
        """Posterior mean; the same as `mean`."""
        return self.mean

    @property
    def seen(self) -> NDArray[Any]:
        """Products of the rows (K,) with the mean; 0 for ignored rows."""
        seen = np.zeros(self.noise.size, self.mean.dtype)
        seen[self._measured] = self._rows @ self.mean.ravel()
        return seen

    def _solved(self, coefficients: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(cho_solve(self._factor, coefficients, check_finite=False))

    def _spread(self, weights: NDArray[Any]) -> NDArray[Any]:
        return np.asarray((weights @ self._rows).reshape(self._prior.shape))

    @property
    def variance(self) -> Floats:
        """Variance of each pixel (H, W), evaluated at one scattered pixel per block."""
        prior = self._field.pixel_variance
        height, width = prior.shape
        down, across = (np.arange(0, side, BLOCK) for side in (height, width))
        offset = np.add.outer(7 * np.arange(down.size), 3 * np.arange(across.size)) % BLOCK**2
        row = np.minimum(down[:, None] + offset // BLOCK, height - 1)
        column = np.minimum(across + offset % BLOCK, width - 1)
        lower, _ = self._factor
        seen = self._seen[:, (row * width + column).ravel()][self._measured]
        whitened = solve_triangular(lower, seen, lower=True, check_finite=False)
        explained = self.contrast**2 * (whitened**2).sum(axis=0).reshape(row.shape)
        left = self.contrast * prior[row, column] - explained
        blocks = np.repeat(np.repeat(left, BLOCK, axis=0), BLOCK, axis=1)
        return np.maximum(blocks[:height, :width], 0)

    def covariance(self, spectrum: NDArray[Any]) -> NDArray[Any]:
        """Product of the posterior covariance and a spectrum (H, W)."""
        weighed = self._prior * spectrum
        return weighed - self._prior * self._spread(self._solved(self._rows @ weighed.ravel()))
