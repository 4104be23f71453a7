"""Fourier patterns: grey cosines, shown with steps of their phase."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..basis import Basis


class Fourier(Basis):
    """Cosines and sines of all N frequencies, a row each, in pairs of cos(a), cos(a + pi / 2).

    a = 2 pi (v y / H + h x / W) in pixel (y, x), of the frequency numbers (v, h) of the discrete
    Fourier transform. They follow each other by v W + h; one whose conjugate (-v, -h) has come
    before is left out, and one that is its own conjugate has no second row. Shown with both
    polarities, the rows of a pair are the four phase steps 0, pi, pi / 2 and 3 pi / 2, and their
    coefficients c1 + i c2 the Fourier coefficient sum x exp(-i a): Z. Zhang, X. Ma and J. Zhong,
    Nat. Commun. 6, 6225 (2015).
    """

    name = "fourier"
    usual_order = "radius"
    level = 0

    @cached_property
    def sign_changes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:  # type: ignore[override]
        """Two in each cycle, at any phase."""
        vertical, horizontal, _ = self._waves
        height, width = self.shape
        down = np.minimum(vertical, height - vertical)
        along = np.minimum(horizontal, width - horizontal)
        return 2 * down, 2 * along

    def row(self, k: int) -> Floats:
        """The k-th row, (H, W)."""
        return self.matrix(np.array([k], np.int32))[0].reshape(self.shape)

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        """The rows ``index`` (K,), (K, N)."""
        vertical, horizontal, second = (part[index][:, None, None] for part in self._waves)
        height, width = self.shape
        y, x = np.arange(height)[:, None], np.arange(width)
        # In whole numbers, so that a turn is one however large the image is.
        turns = (vertical * y % height) / height + (horizontal * x % width) / width
        return np.cos(2 * np.pi * turns + np.pi / 2 * second).reshape(len(index), -1)

    @cached_property
    def _waves(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Frequency numbers v and h of every row, and whether it is the second of its pair."""
        height, width = self.shape
        vertical, horizontal = np.divmod(np.arange(self.pixels), width)
        conjugate = -vertical % height * width + -horizontal % width
        number = np.arange(self.pixels)
        first = np.flatnonzero(number <= conjugate)
        rows = np.where(conjugate[first] == first, 1, 2)
        each = np.repeat(first, rows)
        second = np.append(0, each[1:] == each[:-1]).astype(np.int64)
        return vertical[each], horizontal[each], second


BASIS = Fourier
