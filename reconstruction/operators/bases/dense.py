"""User-defined patterns: random, learned or greyscale."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats
from ...base.errors import InputError
from ..basis import Basis


class Dense(Basis):
    """Patterns (R, H, W) of transmittance 0..1; the rows h are 2 p - 1.

    Raises InputError for another shape, no pattern, or values outside 0..1.
    """

    name = "dense"
    arrays = ("patterns",)

    def __init__(self, patterns: ArrayLike) -> None:
        values = np.asarray(patterns)
        if values.ndim != 3 or not values.size or values.dtype.kind not in "iufb":
            raise InputError(
                f"patterns of shape {values.shape} and type {values.dtype}: must be a "
                "numeric array (patterns, rows, columns)"
            )
        super().__init__((values.shape[1], values.shape[2]))
        good = (values >= 0) & (values <= 1)
        if not good.all():
            index = tuple(int(n) for n in np.unravel_index(good.argmin(), values.shape))
            raise InputError(
                f"patterns: the value at {list(index)} is {values[index]}; transmittances must "
                "lie in 0..1 (indices count from 0)"
            )
        self.patterns = values.astype(np.float32)

    @property
    def rows(self) -> int:
        return len(self.patterns)

    @cached_property
    def dc_row(self) -> int | None:
        lit = np.flatnonzero((self.patterns == 1).all(axis=(1, 2)))
        return int(lit[0]) if lit.size else None

    def row(self, k: int) -> Floats:
        return 2.0 * self.patterns[k].astype(np.float64) - 1.0

    @classmethod
    def restored(cls, shape: tuple[int, int], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Basis of the stored patterns; raises InputError if they do not have this shape."""
        basis = cls(arrays["patterns"])
        if basis.shape != tuple(shape):
            raise InputError(f"patterns of {basis.shape} in a plan of shape {tuple(shape)}")
        return basis

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        chosen = self.patterns[index].reshape(len(index), -1)
        return 2.0 * chosen.astype(np.float64) - 1.0


BASIS = Dense
