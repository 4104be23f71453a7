"""Average of randomised pursuits instead of the single most probable sparse image.

Where many sparse explanations are nearly equally good, their mean comes close to the minimum mean
squared error, and no single one does (M. Elad, I. Yavneh, IEEE Trans. Inf. Theory 55, 4701 (2009)).
Coefficients are

    m = R (sum_k u_k a_k + z) + n,

with z the Gaussian field of least squares with contrast v, and each atom a_k of a dictionary
present or absent; if present, its variance exceeds that in the field. In coordinates that whiten R
z + n, pursuits draw their atoms by the evidence for each. The posterior mean of z is that of the
residual of the mean pursuit, and its variance that of least squares; the spread of the pursuits'
images, each with its own z, is the uncertainty of the atoms.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.learned import DICTIONARY
from ..dictionary import Dictionary, StrongestAtoms
from ..method import Estimate, ImageSolver
from ..omp.randomised import pursue_randomly
from .least_squares import METHOD as LEAST_SQUARES
from .least_squares import LeastSquaresSolver

ATOMS = 1024
"""Size of the dictionary: the atoms of highest expected energy in the measurement."""
PURSUITS = 16
MAX_CHOSEN = 32
"""Maximum number of atoms per pursuit."""
ODDS = 0.03
"""Prior odds that an atom is present."""
BRIGHTER = 10.0
"""Variance of a present atom, relative to that in Gaussian images."""


@dataclass(frozen=True)
class RandomPursuit:
    """Mean of randomised pursuits with the atoms of a dictionary."""

    title = "randomised pursuits"
    dictionary: Dictionary = DICTIONARY

    def compile(self, operator: MeasurementOperator) -> ImageSolver:
        """Solver of an operator's coefficients; least squares beyond its size limit."""
        linear = LEAST_SQUARES.compile(operator)
        if not isinstance(linear, LeastSquaresSolver):
            return linear
        return RandomPursuitSolver(linear, self.dictionary)


class RandomPursuitSolver:
    """Solver with all that depends on the operator alone."""

    def __init__(self, linear: LeastSquaresSolver, dictionary: Dictionary) -> None:
        self._linear = linear
        self._atoms = StrongestAtoms(linear.operator, dictionary, ATOMS)
        seen, expected = np.trace(linear.model.gram), self._atoms.expected.sum()
        # The rows see the same energy of all atoms as of the field.
        self._scale = float(np.sqrt(seen / expected)) if expected > 0 else 0.0
        self._draws: Floats = np.random.default_rng(0).random((PURSUITS, MAX_CHOSEN))

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Mean image of the pursuits; reproducible for equal coefficients."""
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
            """Posterior mean spectra of the field, from the residuals (..., K) of the atoms."""
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
