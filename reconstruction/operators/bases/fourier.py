"""Fourier patterns: greyscale cosines, displayed in phase steps."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..basis import Basis


class Fourier(Basis):
    """Cosines and sines of all N frequencies, in pairs of rows cos(a), cos(a + pi / 2).

    In pixel (y, x), a = 2 pi (v y / H + h x / W), with v and h the frequency indices of the
    discrete Fourier transform. Rows are sorted by v W + h. Of two conjugate frequencies, (v, h) and
    (-v, -h), only the first has rows; a frequency that is its own conjugate has one row. Displayed
    with both polarities, the rows of a pair are the phase steps 0, pi, pi / 2 and 3 pi / 2, and
    their coefficients c1 + i c2 equal the Fourier coefficient sum x exp(-i a): Z. Zhang, X. Ma and
    J. Zhong, Nat. Commun. 6, 6225 (2015).
    """

    name = "fourier"
    usual_order = "radius"
    dc_row = 0

    @cached_property
    def sign_changes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:  # type: ignore[override]
        """Two per cycle, at any phase."""
        vertical, horizontal, _ = self._waves
        height, width = self.shape
        down = np.minimum(vertical, height - vertical)
        along = np.minimum(horizontal, width - horizontal)
        return 2 * down, 2 * along

    def row(self, k: int) -> Floats:
        return self.matrix(np.array([k], np.int32))[0].reshape(self.shape)

    def matrix(self, index: NDArray[np.int32]) -> Floats:
        vertical, horizontal, second = (part[index][:, None, None] for part in self._waves)
        height, width = self.shape
        y, x = np.arange(height)[:, None], np.arange(width)
        # Reduced in integers, so that phases stay exact for large images.
        turns = (vertical * y % height) / height + (horizontal * x % width) / width
        return np.cos(2 * np.pi * turns + np.pi / 2 * second).reshape(len(index), -1)

    @cached_property
    def _waves(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Frequency indices v and h of every row, and whether it is the second of its pair."""
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
