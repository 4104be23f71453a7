"""Hadamard patterns with scrambled pixels: noise-like, with a fast transform."""

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats
from ...base.errors import InputError
from ..basis import Basis
from .hadamard import Hadamard


class Scrambled(Basis):
    """Hadamard rows whose column j is displayed at pixel ``permutation[j]``.

    This is the scrambled block Hadamard ensemble of L. Gan, T. T. Do and T. D. Tran, EUSIPCO
    (2008), with the whole image as its only block: smaller blocks light few pixels at a time, so
    that readings are noisier. No order sorts these rows by spatial frequency. Raises InputError
    unless ``permutation`` (N,) is a permutation and both sides of the shape are powers of two.
    """

    name = "scrambled"
    orthogonal = True
    dc_row = 0
    arrays = ("permutation",)
    seeded = True

    def __init__(self, shape: tuple[int, int], permutation: ArrayLike) -> None:
        self._plain = Hadamard(shape)
        super().__init__(self._plain.shape)
        pixels = np.asarray(permutation)
        if not np.array_equal(np.sort(pixels.ravel()), np.arange(self.pixels)):
            raise InputError(
                f"permutation of {pixels.size} numbers: must contain 0..{self.pixels - 1} once"
            )
        self.permutation = pixels.ravel().astype(np.int32)

    def row(self, k: int) -> Floats:
        return self._placed(self._plain.row(k).ravel()).reshape(self.shape)

    def project(self, images: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        return self._plain.project(images[..., self.permutation], index)

    def combine(self, weights: NDArray[Any], index: NDArray[np.int32]) -> NDArray[Any]:
        return self._placed(self._plain.combine(weights, index))

    @classmethod
    def restored(cls, shape: tuple[int, int], arrays: Mapping[str, NDArray[Any]]) -> Self:
        return cls(shape, arrays["permutation"])

    @classmethod
    def drawn(cls, shape: tuple[int, int], rng: np.random.Generator) -> Self:
        return cls(shape, rng.permutation(Hadamard(shape).pixels))

    def _placed(self, columns: NDArray[Any]) -> NDArray[Any]:
        """Move columns (..., N) to their pixels."""
        pixels = np.empty_like(columns)
        pixels[..., self.permutation] = columns
        return pixels


BASIS = Scrambled
