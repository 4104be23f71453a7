"""Orthogonal matching pursuit with the statistics of natural images.

The image is sparse in a dictionary. A few low-frequency patterns barely see most of its atoms, and
a pursuit with normalised columns then fits noise with invisible atoms. Here each atom is scaled by
its standard deviation in natural images, so that atoms compete by what they are expected to
explain, and a ridge that matches the noise keeps the weak ones small.
"""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats
from ...operators import MeasurementOperator
from ..coefficients import Coefficients
from ..dictionaries.dct import DICTIONARY
from ..dictionary import Dictionary, StrongestAtoms
from ..method import Estimate
from ..omp import batch_omp
from ..prior import fit_variance
from .least_squares import METHOD as LEAST_SQUARES

ATOMS = 1024
"""Size of the dictionary: the atoms of highest expected energy in the measurement."""
MAX_CHOSEN = 128
"""Maximum number of atoms per image."""


@dataclass(frozen=True)
class Pursuit:
    """Matching pursuit with the atoms of a dictionary."""

    title = "matching pursuit"
    dictionary: Dictionary = DICTIONARY

    def compile(self, operator: MeasurementOperator) -> "PursuitSolver":
        return PursuitSolver(operator, self.dictionary)


class PursuitSolver:
    """Solver with all that depends on the operator alone."""

    def __init__(self, operator: MeasurementOperator, dictionary: Dictionary) -> None:
        self.operator = operator
        self._linear = LEAST_SQUARES.compile(operator)
        self.varying = operator.varying
        self.atoms = StrongestAtoms(operator, dictionary, ATOMS)
        usual = operator.usual_noise[self.varying]
        self._trust: Floats = usual.min(initial=np.inf) / usual  # noisy rows count less
        self._columns: Floats = self._trust[:, None] * self.atoms.columns
        self._expected: Floats = self._trust**2 * self.atoms.expected
        self.gram = self._columns.T @ self._columns

    def __call__(self, coefficients: Coefficients) -> Estimate:
        """Image (H, W); what the atoms do not explain is estimated by least squares."""
        length = self.operator.row_length
        seen = self.varying & coefficients.measured
        measured = coefficients.values[seen] / length
        if not measured.any():
            return Estimate(self.operator.min_norm(coefficients.values))
        rows = coefficients.measured[self.varying]
        columns, gram, expected = self._columns, self.gram, self._expected
        if measured.size < len(columns):
            lost = columns[~rows]
            columns, expected = columns[rows], expected[rows]
            gram = gram - lost.T @ lost
        weighed = self._trust[rows] * measured
        variance, ridge = fit_variance(weighed, expected)
        values = batch_omp(
            gram,
            columns.T @ weighed,
            float(np.vdot(weighed, weighed).real),
            ridge=ridge,
            tolerance=measured.size * variance * ridge,
            max_atoms=min(MAX_CHOSEN, measured.size),
        )
        left = coefficients.values.copy()
        left[seen] = (weighed - columns @ values) / self._trust[rows] * length
        rest = self._linear(Coefficients(left, coefficients.noise))
        return Estimate(self.atoms.image(values) + rest.image)


METHOD = Pursuit()
