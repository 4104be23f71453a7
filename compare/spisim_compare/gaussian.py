"""Covariances of many readings that have few errors in common."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats, Mask


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance diag(variance) + F F^T of n readings, with ``factors`` F (n, r).

    Its inverse follows from the identity of Woodbury, so that thousands of readings cost no more
    than their number times r^2.
    """

    variance: Floats
    factors: Floats

    def plus(self, factors: Sequence[Floats]) -> "Covariance":
        """The same with further errors that readings have in common, each (n, r)."""
        return Covariance(self.variance, np.hstack([self.factors, *factors]))

    def only(self, readings: Mask) -> "Covariance":
        """Covariance of some of the readings."""
        return Covariance(self.variance[readings], self.factors[readings])

    def solve(self, columns: Floats) -> Floats:
        """Inverse times columns (n, ...)."""
        own = (columns.T / self.variance).T
        if not self.factors.shape[1]:
            return np.asarray(own)
        scaled = self.factors / self.variance[:, None]
        shared = np.linalg.solve(self._capacitance, self.factors.T @ own)
        return np.asarray(own - scaled @ shared)

    def whiten(self, columns: Floats) -> Floats:
        """The inverse's symmetric root, up to a rotation, times columns (n, ...).

        With D^-1/2 F = U S V^T it is (I - U (I - (I + S^2)^-1/2) U^T) D^-1/2.
        """
        own = (columns.T / np.sqrt(self.variance)).T
        if not self.factors.shape[1]:
            return np.asarray(own)
        left, strength = self._scaled_factors
        shrunk = (1 - 1 / np.sqrt(1 + strength**2)) * (left.T @ own).T
        return np.asarray(own - left @ shrunk.T)

    @property
    def total(self) -> Floats:
        """Variance (n,) of each reading."""
        return np.asarray(self.variance + (self.factors**2).sum(axis=1))

    @cached_property
    def log_determinant(self) -> float:
        """Logarithm of the determinant."""
        of_factors = np.linalg.slogdet(self._capacitance)[1] if self.factors.shape[1] else 0.0
        return float(np.log(self.variance).sum() + of_factors)

    @cached_property
    def _scaled_factors(self) -> tuple[Floats, Floats]:
        scaled = self.factors / np.sqrt(self.variance)[:, None]
        left, strength, _ = np.linalg.svd(scaled, full_matrices=False)
        return left, strength

    @cached_property
    def _capacitance(self) -> NDArray[np.float64]:
        scaled = self.factors / self.variance[:, None]
        return np.eye(self.factors.shape[1]) + self.factors.T @ scaled


@dataclass(frozen=True, eq=False)
class Fit:
    """Weighted least squares: parameters (k,), their covariance (k, k), and the remainder (n,)."""

    theta: Floats
    covariance: Floats
    remainder: Floats
    chi_squared: float


def least_squares(difference: Floats, directions: Floats, noise: Covariance) -> Fit:
    """Fit ``difference`` (n,) by ``directions`` (n, k)."""
    if not directions.shape[1]:
        chi_squared = float(difference @ noise.solve(difference))
        return Fit(np.zeros(0), np.zeros((0, 0)), difference, chi_squared)
    weighted = noise.solve(directions)
    inverse = np.linalg.pinv(directions.T @ weighted, hermitian=True)
    covariance: Floats = np.asarray(inverse, dtype=np.float64)
    theta = covariance @ (weighted.T @ difference)
    remainder = difference - directions @ theta
    return Fit(theta, covariance, remainder, float(remainder @ noise.solve(remainder)))
