"""Dictionaries: bands of atoms that images consist of."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator


@dataclass(frozen=True, eq=False)
class Band:
    """Outer products of one-dimensional atoms, and their strengths.

    Parameters
    ----------
    vertical, horizontal
        One-dimensional atoms (H, a) and (W, b), in columns.
    sigma
        Relative standard deviation (a, b) of the coefficients in natural images; 0 for the constant
        image, as the DC coefficient is measured separately.
    """

    vertical: Floats
    horizontal: Floats
    sigma: Floats


class Dictionary(Protocol):
    """Atoms of images of any shape, in bands; not necessarily orthonormal or complete."""

    def __hash__(self) -> int:
        """Solvers are cached by dictionary."""

    def bands(self, shape: tuple[int, int]) -> Sequence[Band]:
        """All atoms of images of a shape (H, W); InputError if it is unsupported."""


class StrongestAtoms:
    """At most ``maximum`` atoms of highest expected energy in the rows of an operator, DC excluded.

    Atoms are scaled by their standard deviation in natural images. ``columns`` (rows, A) are the
    products of the rows, normalised to length 1, with the scaled atoms; ``expected`` (rows,) is the
    variance of the rows if all atoms are independent, up to a common factor.
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
        self._index = strongest - (ends - [each.size for each in energy])[self._band]
        self.columns: Floats = np.empty((self.expected.size, strongest.size))
        for number in np.unique(self._band):
            there, indices = self._members(number)
            sigma = self._bands[number].sigma[indices]
            self.columns[:, there] = seen[number].of(indices) * sigma

    def image(self, values: NDArray[Any]) -> NDArray[Any]:
        """Zero-mean images (..., H, W) of the scaled atoms times ``values`` (..., A)."""
        stack = values.shape[:-1]
        image = np.zeros((*stack, *self._shape), dtype=values.dtype)
        for number in np.unique(self._band[values.reshape(-1, self._band.size).any(axis=0)]):
            band = self._bands[number]
            there, indices = self._members(number)
            spectrum = np.zeros((*stack, *band.sigma.shape), dtype=values.dtype)
            spectrum[..., indices[0], indices[1]] = band.sigma[indices] * values[..., there]
            image += band.vertical @ spectrum @ band.horizontal.T
        return np.asarray(image - image.mean(axis=(-2, -1), keepdims=True))

    def _members(self, number: int) -> tuple[NDArray[np.bool_], tuple[NDArray[np.intp], ...]]:
        """Mask of the atoms in a band, and their row and column indices in it."""
        there = self._band == number
        return there, np.unravel_index(self._index[there], self._bands[number].sigma.shape)
