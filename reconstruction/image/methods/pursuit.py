"""Orthogonal matching pursuit that knows what natural images look like.

The image is sparse in a dictionary; few low-frequency patterns see most of its atoms weakly or not
at all, and a pursuit that normalises its columns then fits noise with invisible atoms. Here each
atom is scaled by its standard deviation in natural images, and the pursuit works in these
coordinates: atoms compete by what they may be expected to explain, and the ridge that matches the
noise keeps the weak ones small.
"""

from dataclasses import dataclass

import numpy as np

from ...arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.dct import DICTIONARY
from ..dictionary import Dictionary
from ..method import Estimate
from ..omp import batch_omp
from ..prior import Prior, fit_variance

ATOMS = 1024
"""Size of the dictionary: the atoms of greatest expected energy in the measurement."""
MAX_CHOSEN = 128
"""Most atoms of one image."""


@dataclass(frozen=True)
class Pursuit:
    """Matching pursuit with the atoms of a dictionary."""

    title = "matching pursuit"
    dictionary: Dictionary = DICTIONARY

    def compile(self, operator: MeasurementOperator) -> "PursuitSolver":
        """Solver of one operator's coefficients."""
        return PursuitSolver(operator, self.dictionary)


class PursuitSolver:
    """Holds what depends on the operator alone; a call is then cheap."""

    def __init__(self, operator: MeasurementOperator, dictionary: Dictionary) -> None:
        self.operator = operator
        self.dictionary = dictionary
        self.varying = operator.varying
        prior = Prior(operator, dictionary)
        seen = prior.deviation**2 * prior.atoms.by_atom()
        strongest = np.argsort(-seen, axis=None, kind="stable")[:ATOMS]
        self.atoms = np.unravel_index(strongest, operator.image_shape)
        self.deviation = prior.deviation[self.atoms]
        self.expected_variance = prior.expected
        self.columns: Floats = prior.atoms.of(self.atoms) * self.deviation
        self.gram: Floats = self.columns.T @ self.columns

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Image (H, W) from coefficients (K,).

        What the pursuit cannot explain is added back by the inverse transform, each coefficient
        weighted by signal / (signal + noise): without noise the image agrees with every
        coefficient, and the pursuit decides only what was not measured. Complex coefficients give
        a complex image.
        """
        length = self.operator.row_length
        seen = self.varying & coefficients.measured
        measured = coefficients.values[seen] / length
        if not measured.any():
            return Estimate(self.operator.least_energy(coefficients.values))
        columns, gram, expected = self.columns, self.gram, self.expected_variance
        if measured.size < len(columns):
            rows = coefficients.measured[self.varying]
            columns, expected = columns[rows], expected[rows]
            gram = columns.T @ columns
        variance, ridge = fit_variance(measured, expected)
        chosen, values = batch_omp(
            gram,
            columns.T @ measured,
            float(np.vdot(measured, measured).real),
            ridge=ridge,
            tolerance=measured.size * variance * ridge,
            max_atoms=min(MAX_CHOSEN, measured.size),
        )
        spectrum = np.zeros(self.operator.image_shape, dtype=measured.dtype)
        spectrum[self.atoms[0][chosen], self.atoms[1][chosen]] = self.deviation[chosen] * values
        unexplained = measured - columns[:, chosen] @ values
        total = variance * (expected + ridge)
        noise = coefficients.noise[seen] / length
        left = coefficients.values.copy()
        left[seen] = unexplained * np.clip(1 - noise**2 / total, 0, 1) * length
        return Estimate(self.dictionary.synthesise(spectrum) + self.operator.least_energy(left))


METHOD = Pursuit()
