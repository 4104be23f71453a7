"""Hadamard patterns, evaluated by the fast Walsh-Hadamard transform.

Row k of the natural-order (Sylvester) Hadamard matrix of size N = H*W, reshaped to (H, W), is the
outer product of row k // W of the size-H matrix and row k % W of the size-W matrix.
"""

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ...base.errors import InputError
from ..basis import Basis
from ..hadamard import fwht, power_of_two, sequency

MAX_SIDE = 4096
"""Longest side whose Hadamard matrix is stored; the fast transform needs no matrix."""


class Hadamard(Basis):
    """All N rows; raises InputError unless both sides of the shape are powers of two."""

    name = "hadamard"
    orthogonal = True
    usual_order = "sequency-2d"
    dc_row = 0

    def __init__(self, shape: tuple[int, int]) -> None:
        super().__init__(shape)
        if not all(power_of_two(side) for side in self.shape):
            height, width = self.shape
            raise InputError(f"pattern shape {height} x {width}: both sides must be powers of two")

    @cached_property
    def factors(self) -> tuple[Floats, Floats] | None:  # type: ignore[override]
        """Hadamard matrices of both sides, or None if they are too large."""
        height, width = self.shape
        if max(height, width) > MAX_SIDE:
            return None
        return fwht(np.eye(height)), fwht(np.eye(width))

    @cached_property
    def sign_changes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:  # type: ignore[override]
        """Sequencies of the two factors of every row."""
        height, width = self.shape
        return np.repeat(sequency(height), width), np.tile(sequency(width), height)

    def row(self, k: int) -> Floats:
        unit = np.zeros(self.pixels)
        unit[k] = 1
        return fwht(unit).reshape(self.shape)

    def project(self, images: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        return fwht(images)[..., index]

    def combine(self, weights: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        dtype = np.result_type(weights, np.float64)
        full = np.zeros((*np.shape(weights)[:-1], self.pixels), dtype)
        full[..., index] = weights
        return fwht(full)


BASIS = Hadamard
