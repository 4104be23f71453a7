"""Hadamard patterns whose pixels are scrambled: noise to the eye, with a fast transform."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats
from ...base.errors import InputError
from ..basis import Basis
from .hadamard import Hadamard


class Scrambled(Basis):
    """Row k has the value of Hadamard row k at column j in the pixel ``permutation`` (N,)[j].

    The scrambled block Hadamard ensemble of L. Gan, T. T. Do and T. D. Tran, EUSIPCO (2008), with
    one block, the whole image: smaller ones light few pixels at a time, and readings get the
    noisier. Its first rows are any; an order that picks low frequencies has none to pick here.
    Raises InputError for what is no permutation, and sides that are no powers of two.
    """

    name = "scrambled"
    orthogonal = True
    level = 0
    arrays = ("permutation",)
    seeded = True

    def __init__(self, shape: tuple[int, int], permutation: ArrayLike) -> None:
        self._plain = Hadamard(shape)
        super().__init__(self._plain.shape)
        pixels = np.asarray(permutation)
        if not np.array_equal(np.sort(pixels.ravel()), np.arange(self.pixels)):
            raise InputError(
                f"permutation holds {pixels.size} numbers; each of 0..{self.pixels - 1} is needed "
                "once"
            )
        self.permutation = pixels.ravel().astype(np.int32)

    def row(self, k: int) -> Floats:
        """The k-th row, (H, W)."""
        return self._placed(self._plain.row(k).ravel()).reshape(self.shape)

    def project(self, images: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        """Sum over the pixels of the rows ``index`` (K,) times images (..., N): (..., K)."""
        return self._plain.project(images[..., self.permutation], index)

    def combine(self, weights: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        """Sum of the rows ``index`` (K,) times their weights (..., K): (..., N)."""
        return self._placed(self._plain.combine(weights, index))

    @classmethod
    def restored(cls, shape: tuple[int, int], arrays: Mapping[str, NDArray[Any]]) -> Self:
        """The basis of this permutation."""
        return cls(shape, arrays["permutation"])

    @classmethod
    def drawn(cls, shape: tuple[int, int], rng: np.random.Generator) -> Self:
        """The basis of a random permutation."""
        return cls(shape, rng.permutation(Hadamard(shape).pixels))

    def _placed(self, columns: NDArray[Any]) -> NDArray[Any]:
        """Values of columns (..., N) in their pixels."""
        pixels = np.empty_like(columns)
        pixels[..., self.permutation] = columns
        return pixels


BASIS = Scrambled
