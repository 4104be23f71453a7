"""Atoms learned from synthetic scenes by tools/learned_dictionary.py; see `learned.json`.

Small squares that overlap by half in a sine window, at every scale up to that of the image, cut off
at its edges, so that they suit images of any shape.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, log2
from pathlib import Path

import numpy as np

from ...base.arrays import Floats
from ..dictionary import Band
from .dct import DICTIONARY as COSINES

FILE = Path(__file__).with_suffix(".npy")
"""Atoms (2, A, SIDE): A outer products of a column and a row."""
SIDE = 8
WINDOW = np.sin(np.pi * (np.arange(SIDE) + 0.5) / SIDE)
"""Squares of neighbouring windows add up to 1."""


class Learned:
    """Squares of SIDE samples, of 1, 2, 4 ... pixels each."""

    def bands(self, shape: tuple[int, int]) -> Sequence[Band]:
        """One band for each atom at each scale."""
        result = []
        for level in range(max(1, ceil(log2(max(shape) / SIDE)) + 1)):
            vertical, horizontal = (
                [_placed(profile, 2**level, side) for profile in profiles]
                for profiles, side in zip(_profiles(), shape, strict=True)
            )
            result += [COSINES.band(*both) for both in zip(vertical, horizontal, strict=True)]
        return result


@lru_cache(maxsize=1)
def _profiles() -> Floats:
    return np.load(FILE, allow_pickle=False) * WINDOW


def _placed(profile: Floats, scale: int, side: int) -> Floats:
    """A profile with samples of ``scale`` pixels, shifted by half its length along an axis."""
    length = SIDE * scale
    at = (np.arange(length) + 0.5) / scale - 0.5
    finer = np.interp(at, np.arange(-1, SIDE + 1), np.pad(profile, 1)) / np.sqrt(scale)
    starts = np.arange(-length // 2, side, length // 2)
    position = np.arange(side)[:, None] - starts
    inside = (position >= 0) & (position < length)
    return np.where(inside, finer[np.clip(position, 0, length - 1)], 0.0)


DICTIONARY = Learned()
