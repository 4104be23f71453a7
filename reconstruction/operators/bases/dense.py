"""Any patterns at all, random, learned or grey, as numbers."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats
from ...base.errors import InputError
from ..basis import Basis


class Dense(Basis):
    """Patterns (R, H, W) of transmittance 0..1 as they are displayed; rows are 2 p - 1.

    Raises InputError for another shape, values outside and no pattern.
    """

    name = "dense"
    arrays = ("patterns",)

    def __init__(self, patterns: ArrayLike) -> None:
        displayed = np.asarray(patterns)
        if displayed.ndim != 3 or not displayed.size or displayed.dtype.kind not in "iufb":
            raise InputError(
                f"patterns of shape {displayed.shape} and type {displayed.dtype}: an array of "
                "numbers (patterns, rows, columns) is needed"
            )
        super().__init__((displayed.shape[1], displayed.shape[2]))
        good = (displayed >= 0) & (displayed <= 1)
        if not good.all():
            index = tuple(int(n) for n in np.unravel_index(good.argmin(), displayed.shape))
            raise InputError(
                f"patterns: the value at {list(index)} is {displayed[index]}; transmittances lie "
                "in 0..1 (positions count from 0)"
            )
        self.patterns = displayed.astype(np.float32)

    @property
    def rows(self) -> int:
        """Number of patterns."""
        return len(self.patterns)

    @cached_property
    def level(self) -> int | None:
        """Number of a pattern that is 1 in every pixel, or None."""
        lit = np.flatnonzero((self.patterns == 1).all(axis=(1, 2)))
        return int(lit[0]) if lit.size else None

    def row(self, k: int) -> Floats:
        """2 p - 1 of the k-th pattern p, (H, W)."""
        return 2.0 * self.patterns[k].astype(np.float64) - 1.0

    @classmethod
    def restored(cls, shape: tuple[int, int], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """The basis of these patterns; InputError where they are not of this shape."""
        basis = cls(arrays["patterns"])
        if basis.shape != tuple(shape):
            raise InputError(f"patterns of {basis.shape} in a plan of shape {tuple(shape)}")
        return basis

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        """2 p - 1 of the patterns ``index`` (K,), (K, N)."""
        chosen = self.patterns[index].reshape(len(index), -1)
        return 2.0 * chosen.astype(np.float64) - 1.0


BASIS = Dense
