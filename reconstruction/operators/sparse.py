"""Sparse matrices with the few operations that decoding needs, in NumPy alone."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask


@dataclass(frozen=True, eq=False)
class SparseRows:
    """Sparse matrix whose rows each have at least one entry.

    Parameters
    ----------
    rows, columns
        Indices (E,) of the entries; ``rows`` ascends.
    values
        Entries (E,).
    shape
        Rows and columns of the matrix.
    """

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    values: Floats
    shape: tuple[int, int]

    def __matmul__(self, vectors: NDArray[Any]) -> NDArray[Any]:
        """Product with vectors (M,) or (M, F)."""
        if not self.rows.size:
            return np.zeros((0, *vectors.shape[1:]), np.result_type(vectors, np.float64))
        values = self.values.reshape(-1, *[1] * (vectors.ndim - 1))
        return np.add.reduceat(values * vectors[self.columns], self._starts, axis=0)

    @cached_property
    def _starts(self) -> NDArray[np.intp]:
        return np.flatnonzero(np.diff(self.rows, prepend=-1))

    def resting_on(self, usable: Mask) -> Mask:
        """Mask of the rows that have entries in ``usable`` columns only."""
        resting = np.ones(self.shape[0], dtype=bool)
        resting[self.rows[~usable[self.columns]]] = False
        return resting

    def only(self, retained: Mask) -> "SparseRows":
        """Rows selected by a mask."""
        entries = retained[self.rows]
        number = np.cumsum(retained) - 1
        return SparseRows(
            number[self.rows[entries]],
            self.columns[entries],
            self.values[entries],
            (int(np.count_nonzero(retained)), self.shape[1]),
        )

    def __pow__(self, power: int) -> "SparseRows":
        """Power of each entry."""
        return SparseRows(self.rows, self.columns, self.values**power, self.shape)
