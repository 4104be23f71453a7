"""Randomised pursuits, averaged: the mean of many sparse images instead of the likeliest one.

Where many sparse explanations are nearly as good, their mean has about the least squared error, and
no single one has (M. Elad, I. Yavneh, IEEE Trans. Inf. Theory 55, 4701 (2009)). Coefficients are

    m = R (sum_k u_k a_k + z) + n,

z the Gaussian field of least squares with contrast v, and each atom a_k of a dictionary there or
not, of larger variance than in such a field if it is. In coordinates in which R z + n is white,
pursuits draw their atoms by the evidence for each. The posterior mean of z is that of what the mean
of the pursuits leaves, its variance that of least squares; images of the pursuits, each with its
own z, spread by as much as is not known of the atoms.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ...operators import MeasurementOperator
from ..atoms import StrongestAtoms
from ..coefficients import Coefficients
from ..dictionaries.learned import DICTIONARY
from ..dictionary import Dictionary
from ..method import Estimate, ImageSolver
from ..omp.randomised import pursue_randomly
from .least_squares import METHOD as LEAST_SQUARES
from .least_squares import LeastSquaresSolver

ATOMS = 1024
"""Size of the dictionary: the atoms of greatest expected energy in the measurement."""
PURSUITS = 16
MAX_CHOSEN = 32
"""Most atoms of one pursuit."""
ODDS = 0.03
"""That an atom is there, beforehand."""
BRIGHTER = 10.0
"""Variance of an atom that is there over what it has where images are Gaussian."""


@dataclass(frozen=True)
class RandomPursuit:
    """Mean of randomised pursuits with the atoms of a dictionary."""

    title = "randomised pursuits"
    dictionary: Dictionary = DICTIONARY

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of one operator's coefficients.

        Of more than least squares reckons with that is the same: little is left to guess.
        """
        linear = LEAST_SQUARES.compile(operator)
        if not isinstance(linear, LeastSquaresSolver):
            return linear
        return RandomPursuitSolver(linear, self.dictionary)


class RandomPursuitSolver:
    """Holds what depends on the operator alone."""

    def __init__(self, linear: LeastSquaresSolver, dictionary: Dictionary) -> None:
        self._linear = linear
        self._atoms = StrongestAtoms(linear.operator, dictionary, ATOMS)
        seen, expected = np.trace(linear.model.gram), self._atoms.expected.sum()
        # Of all atoms together the rows see as much as of the field.
        self._scale = float(np.sqrt(seen / expected)) if expected > 0 else 0.0
        self._draws: Floats = np.random.default_rng(0).random((PURSUITS, MAX_CHOSEN))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Mean of the pursuits' images; the same coefficients always give the same."""
        linear = self._linear
        start = linear.posterior(coefficients)
        if start is None:
            return linear.flat(coefficients)
        measured, noise = linear.varying(coefficients)
        finite = np.isfinite(noise)
        field, rows = linear.model.field, linear.model.rows[finite]
        covariance = start.contrast * linear.model.gram[np.ix_(finite, finite)]
        covariance[np.diag_indices_from(covariance)] += start.noise[finite] ** 2
        whitening = np.linalg.inv(np.linalg.cholesky(covariance))

        def rest(left: NDArray[np.inexact]) -> NDArray[np.inexact]:
            """Posterior mean spectra of the field, from what atoms leave over (..., K)."""
            spectra = (left @ whitening.T @ whitening) @ rows
            shaped = spectra.reshape(*left.shape[:-1], *field.variance.shape)
            return np.asarray(start.contrast * field.variance * shaped)

        columns = self._scale * self._atoms.columns[finite]
        white = whitening @ columns
        pursuits = pursue_randomly(
            white.T @ white,
            whitening @ measured[finite] @ white,
            ridge=1 / (BRIGHTER * start.contrast),
            odds=ODDS,
            draws=self._draws,
        )
        values = pursuits.mean(axis=0)
        apart = pursuits - values
        spread = self._scale * self._atoms.image(apart) - field.image(rest(apart @ columns.T))
        variance = linear.variance(start) + (np.abs(spread) ** 2).mean(axis=0)
        spectrum = rest(measured[finite] - columns @ values)
        result = linear.estimate(spectrum, variance, coefficients)
        return Estimate(result.image + self._scale * self._atoms.image(values), result.sigma)


METHOD = RandomPursuit()
