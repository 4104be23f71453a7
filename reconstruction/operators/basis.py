"""Base class of pattern bases, with the seeds and sign changes that orders use."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError

Counts = NDArray[np.int64]
MAX_PIXELS = 2**24
"""Larger shapes are taken to be mistakes: their arrays would fill the memory."""


class Basis(ABC):
    """Rows h_k (H, W) with values in -1..1; the display shows (1 + h_k) / 2 or (1 - h_k) / 2.

    A simple basis defines `name` and `row`. One with a fast transform also overrides `project` and
    `combine`; one that is not determined by its shape lists its `arrays`.

    Parameters
    ----------
    shape
        Rows H and columns W of a pattern, in virtual pixels; InputError if it is invalid.
    """

    name: ClassVar[str]
    factors: tuple[Floats, Floats] | None = None
    """Matrices (H, H) and (W, W) of a separable basis: row k is the outer product of k // W and k %
    W."""
    orthogonal: ClassVar[bool] = False
    """Whether all rows are orthogonal and of length sqrt(N)."""
    usual_order: ClassVar[str] = "natural"
    """Default order, which puts the most informative rows first if one is known."""
    arrays: ClassVar[tuple[str, ...]] = ()
    """Attributes that a file must store besides name and shape."""
    seeded: ClassVar[bool] = False
    """Whether `drawn` creates a basis from a shape and a seed."""
    sign_changes: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None
    """Sign changes of every row, (rows,) each: down a column and along a row of the image."""

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
    def dc_row(self) -> int | None:
        """Index of the row that is 1 in every pixel, or None."""
        return None

    @abstractmethod
    def row(self, k: int) -> Floats:
        """Row k, (H, W)."""

    def project(self, images: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        """Products of images (..., N) and the rows ``index`` (K,), summed over pixels: (..., K)."""
        return images @ self.matrix(index).T

    def combine(self, weights: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        """Sum of the rows ``index`` (K,), weighted by ``weights`` (..., K): (..., N)."""
        return weights @ self.matrix(index)

    @classmethod
    def restored(cls, shape: tuple[int, int], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Basis of this shape and its stored ``arrays``; InputError if they do not fit."""
        return cls(shape)

    @classmethod
    def drawn(cls, shape: tuple[int, int], rng: np.random.Generator) -> Self:
        """Random basis of this shape, if it is `seeded`."""
        raise NotImplementedError

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        """Rows ``index`` (K,) as a matrix (K, N)."""
        return np.stack([self.row(int(k)).ravel() for k in index])


def checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns of a pattern as integers; InputError unless 1 <= H * W <= `MAX_PIXELS`."""
    height, width = (int(side) for side in shape)
    if height < 1 or width < 1:
        raise InputError(f"pattern shape {height} x {width}: both sides must be at least 1")
    if height * width > MAX_PIXELS:
        raise InputError(f"pattern shape {height} x {width}: at most {MAX_PIXELS} pixels")
    return height, width


def sign_changes(basis: Basis, order: str) -> tuple[Counts, Counts]:
    """Sign changes of every row, down and along; InputError naming the ``order`` if undefined."""
    if basis.sign_changes is None:
        raise InputError(
            f"order {order!r} needs sign changes, which basis {basis.name!r} lacks: use natural"
        )
    return basis.sign_changes


def frequencies(basis: Basis, order: str) -> tuple[Floats, Floats]:
    """Sign changes divided by the side: twice the spatial frequency in cycles per pixel."""
    vertical, horizontal = sign_changes(basis, order)
    height, width = basis.shape
    return vertical / height, horizontal / width


def generator_of(kind: str, name: str, *, seeded: bool) -> np.random.Generator | None:
    """Random generator for the seed in a name such as "random:7"; None if not ``seeded``."""
    bare, colon, seed = name.partition(":")
    if not seeded:
        if colon:
            raise InputError(f"{kind} {bare!r} takes no seed, got {seed!r}")
        return None
    if not (seed.isascii() and seed.isdecimal()):
        raise InputError(
            f"{kind} {name!r}: add a seed after a colon, a whole number from 0, such as {bare}:1"
        )
    return np.random.default_rng(int(seed))
