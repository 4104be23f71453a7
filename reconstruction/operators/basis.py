"""What a set of patterns is made of."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError

MAX_PIXELS = 2**24
"""Beyond so many a shape is a mistake, and its arrays fill any memory."""


class Basis(ABC):
    """Rows h_k (H, W) with values from -1 to 1; the display shows (1 + h_k)/2 or (1 - h_k)/2.

    A basis of few lines says its `name` and its `row`s. One with a fast transform has its own
    `project` and `combine`; one that a shape does not tell has `arrays`.
    """

    name: ClassVar[str]
    factors: tuple[Floats, Floats] | None = None
    """Rows of a basis of outer products, (H, H) and (W, W): row k is that of both k // W, k % W."""
    orthogonal: ClassVar[bool] = False
    """Whether all rows are orthogonal and of length sqrt(N)."""
    usual_order: ClassVar[str] = "natural"
    """Order in which the rows that tell most of an image come first, as far as one is known."""
    arrays: ClassVar[tuple[str, ...]] = ()
    """Names of the arrays that a file must hold beside name and shape: attributes of the basis."""
    seeded: ClassVar[bool] = False
    """Whether `drawn` makes one from a shape and a seed."""
    sign_changes: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
    """Of every row, (rows,) each: down a column of the image, and along a row of it."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = checked_shape(shape)

    @property
    def pixels(self) -> int:
        """Number of virtual pixels, N."""
        return self.shape[0] * self.shape[1]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.pixels

    @property
    def level(self) -> int | None:
        """Number of the row that is 1 in every pixel, or None."""
        return None

    @abstractmethod
    def row(self, k: int) -> Floats:
        """The k-th row, (H, W)."""

    def project(self, images: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        """Sum over the pixels of the rows ``index`` (K,) times images (..., N): (..., K)."""
        return images @ self.matrix(index).T

    def combine(self, weights: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        """Sum of the rows ``index`` (K,) times their weights (..., K): (..., N)."""
        return weights @ self.matrix(index)

    @classmethod
    def restored(cls, shape: tuple[int, int], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """The basis of this shape and its ``arrays``; InputError where they do not fit."""
        return cls(shape)

    @classmethod
    def drawn(cls, shape: tuple[int, int], rng: np.random.Generator) -> Self:
        """A basis of this shape, drawn by chance, where it is `seeded`."""
        raise NotImplementedError

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        """The rows ``index`` (K,), (K, N)."""
        return np.stack([self.row(int(k)).ravel() for k in index])


def checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns of a pattern; InputError where there can be no such patterns."""
    height, width = (int(side) for side in shape)
    if height < 1 or width < 1:
        raise InputError(f"pattern shape {height} x {width}: both sides must be at least 1")
    if height * width > MAX_PIXELS:
        raise InputError(f"pattern shape {height} x {width}: at most {MAX_PIXELS} pixels")
    return height, width
