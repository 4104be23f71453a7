"""Those atoms of a dictionary that the rows of an operator see most of."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .dictionary import Dictionary


class StrongestAtoms:
    """The ``maximum`` atoms of greatest expected energy in the rows other than the level.

    Atoms are scaled by their deviations in natural images: ``columns`` (rows, A) is what the rows,
    of length 1, see of each. ``expected`` (rows,): their variances if coefficients of all atoms
    were independent, up to a common factor.
    """

    def __init__(self, operator: MeasurementOperator, dictionary: Dictionary, maximum: int) -> None:
        self._shape = operator.image_shape
        self._bands = dictionary.bands(self._shape)
        seen = [operator.in_atoms(band.vertical, band.horizontal) for band in self._bands]
        variances = [band.sigma**2 for band in self._bands]
        self.expected: Floats = sum(
            (each.by_row(variance) for each, variance in zip(seen, variances, strict=True)),
            start=np.zeros(int(operator.varying.sum())),
        )
        energy = [
            (each.by_atom() * variance).ravel()
            for each, variance in zip(seen, variances, strict=True)
        ]
        strongest = np.argsort(-np.concatenate(energy), kind="stable")[:maximum]
        ends = np.cumsum([each.size for each in energy])
        self._band = np.searchsorted(ends, strongest, side="right")
        self._place = strongest - (ends - [each.size for each in energy])[self._band]
        self.columns: Floats = np.empty((self.expected.size, strongest.size))
        for number in np.unique(self._band):
            there, positions = self._positions(number)
            sigma = self._bands[number].sigma[positions]
            self.columns[:, there] = seen[number].of(positions) * sigma

    def image(self, values: NDArray[Any]) -> NDArray[Any]:
        """Sums (..., H, W) of the scaled atoms times their ``values`` (..., A), less their means.

        The level is measured by itself.
        """
        stack = values.shape[:-1]
        image = np.zeros((*stack, *self._shape), dtype=values.dtype)
        for number in np.unique(self._band[values.reshape(-1, self._band.size).any(axis=0)]):
            band = self._bands[number]
            there, positions = self._positions(number)
            spectrum = np.zeros((*stack, *band.sigma.shape), dtype=values.dtype)
            spectrum[..., positions[0], positions[1]] = band.sigma[positions] * values[..., there]
            image += band.vertical @ spectrum @ band.horizontal.T
        return np.asarray(image - image.mean(axis=(-2, -1), keepdims=True))

    def _positions(self, number: int) -> tuple[NDArray[np.bool_], tuple[NDArray[np.intp], ...]]:
        """Which of the atoms are of a band, and where in it."""
        there = self._band == number
        return there, np.unravel_index(self._place[there], self._bands[number].sigma.shape)
