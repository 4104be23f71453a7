"""Coefficients turned to differences of neighbouring blocks, as far as the rows resolve them.

Rows of Hadamard patterns see the whole image: their coefficients of a letter on a dark ground look
as random as noise. Differences of blocks are 0 wherever the image is flat. An orthogonal matrix
leaves white noise white, so the same coefficients may be judged in both (`noise`).
"""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..operators import MeasurementOperator

MAX_ROWS = 1024
"""Maximum number of rows that are turned, with a square matrix."""
MIN_SEEN = 0.5
"""Minimum mean energy of the differences that the rows must see."""


class Localised:
    """Turn of the rows of an operator, DC excluded, to the differences that they see best."""

    def __init__(self, operator: MeasurementOperator) -> None:
        self._products: Floats | None = None
        if np.count_nonzero(operator.varying) <= MAX_ROWS:
            shape = operator.image_shape
            atoms = operator.in_atoms(*map(block_differences, shape))
            self._products = atoms.of(tuple(np.indices(shape).reshape(2, -1)))
        self._last: tuple[bytes, Floats | None] | None = None

    def __call__(self, given: Mask) -> Floats | None:
        """Orthogonal matrix (K, K) for ``given`` rows, None if they resolve too little."""
        if self._products is None:
            return None
        key = np.packbits(given).tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, _nearest_turn(self._products[given])
        return self._last[1]


def _nearest_turn(products: Floats) -> Floats | None:
    """Orthogonal matrix nearest to the products (K, N) with the K atoms that are seen best."""
    seen = (products**2).sum(axis=0)
    best = np.argsort(-seen, kind="stable")[: len(products)]
    if not best.size or seen[best].mean() < MIN_SEEN:
        return None
    left, _, right = np.linalg.svd(products[:, best])
    return np.asarray(left @ right)


def block_differences(side: int) -> Floats:
    """Orthonormal Haar functions (side, side) in columns, of halves of any length."""
    columns: list[NDArray[np.float64]] = [np.full(side, side**-0.5)]
    blocks = [(0, side)]
    for start, end in blocks:
        if end - start > 1:
            middle = (start + end) // 2
            column = np.zeros(side)
            column[start:middle], column[middle:end] = 1 / (middle - start), -1 / (end - middle)
            columns.append(column / np.sqrt(column @ column))
            blocks += [(start, middle), (middle, end)]
    return np.array(columns).T
