"""Orthonormal wavelets for images of any shape.

S. G. Mallat, IEEE Trans. PAMI 11, 674 (1989); filters by I. Daubechies, Comm. Pure Appl. Math. 41,
909 (1988). The wavelets of the whole plane are cut off at the edges of the image, so they form a
tight frame rather than an orthonormal basis, but nothing wraps around the edges. Each has the
variance that it has in a field whose power falls with the square of spatial frequency.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2

import numpy as np

from ...base.arrays import Floats
from ...base.errors import InputError
from ..dictionary import Band
from .dct import DICTIONARY as COSINES


@dataclass(frozen=True)
class Wavelets:
    """Bands of a wavelet family, named as in PyWavelets."""

    family: str

    def bands(self, shape: tuple[int, int]) -> Sequence[Band]:
        """Detail bands of all scales and an approximation; InputError if PyWavelets is missing."""
        low = _low_pass(self.family)
        high = low[::-1] * (-1.0) ** np.arange(len(low))
        smooth, result = np.ones(1), []
        for level in range(max(1, ceil(log2(2 * max(shape) / len(low))))):
            detail, smooth = (_finer(smooth, taps, 2**level) for taps in (high, low))
            scale = 2 ** (level + 1)
            both = [[_shifted(one, scale, side) for one in (smooth, detail)] for side in shape]
            (tall, tall_detail), (wide, wide_detail) = both
            pairs = [(tall, wide_detail), (tall_detail, wide), (tall_detail, wide_detail)]
            result += [COSINES.band(*pair) for pair in pairs]
        return [*result, COSINES.band(tall, wide)]


def _low_pass(family: str) -> Floats:
    """Low-pass filter of a family, of length 1."""
    if family == "haar":
        return np.full(2, np.sqrt(0.5))
    try:
        import pywt
    except ImportError:
        raise InputError(
            f"dictionary {family!r} needs PyWavelets: pip install 'spisim[wavelets]'"
        ) from None
    return np.asarray(pywt.Wavelet(family).rec_lo)


def _finer(smooth: Floats, taps: Floats, step: int) -> Floats:
    """Function of the next scale: a combination of copies of ``smooth``, ``step`` pixels apart."""
    spread = np.zeros(step * (len(taps) - 1) + 1)
    spread[::step] = taps
    return np.convolve(spread, smooth)


def _shifted(function: Floats, step: int, side: int) -> Floats:
    """Shifts by multiples of ``step`` that overlap an axis (side,), in columns."""
    first = -((len(function) - 1) // step) * step
    starts = np.arange(first, side, step)
    position = np.arange(side)[:, None] - starts
    inside = (position >= 0) & (position < len(function))
    return np.where(inside, function[np.clip(position, 0, len(function) - 1)], 0.0)
