"""Other transforms whose coefficients may be mistaken for Hadamard's, and their spectra.

Each is complete, with coefficients (H, W) arranged as software arranges them, DC first. Names
appear in messages.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from ..base.arrays import Floats
from .dictionaries.dct import DICTIONARY
from .spectra import powers


@lru_cache(maxsize=16)
def haar(side: int) -> Floats:
    """Orthonormal Haar wavelets (side, side) of a side 2^n: the constant, then the widest first."""
    rows = np.eye(1)
    while len(rows) < side:
        finest = np.kron(np.eye(len(rows)), [1, -1])
        rows = np.vstack([np.kron(rows, [1, 1]), finest]) / np.sqrt(2)
    return rows


def other_spectra(shape: tuple[int, int]) -> Iterator[tuple[str, Floats]]:
    """Names of transforms, and the variances (models, N) of their coefficients, 0 for DC."""
    transforms = _ANY | _SQUARE if shape[0] == shape[1] else _ANY
    for name, variance in transforms.items():
        yield name, np.array([variance(power).ravel() for power in powers(shape)])


def _haar_of_axes(power: Floats) -> Floats:
    return _seen(power, *(haar(side) for side in power.shape))


def _haar_pyramid(power: Floats) -> Floats:
    """Bands of S. G. Mallat, IEEE Trans. PAMI 11, 674 (1989): equal scales along both axes."""
    side = len(power)
    result = np.zeros(power.shape)
    size = side
    while size > 1:
        half = size // 2
        means = np.kron(np.eye(half), np.full(side // half, np.sqrt(half / side)))
        both = np.vstack([means, haar(side)[half:size]])
        band = _seen(power, both, both)
        band[:half, :half] = 0  # belongs to the coarser bands
        result[:size, :size] += band
        size = half
    return result


def _haar_pyramid_of_signs(power: Floats) -> Floats:
    """Wavelets of -1, 0 and 1, as displayed, instead of unit length."""
    side = len(power)
    scale = 2.0 ** np.floor(np.log2(np.maximum(np.arange(side), 1)))
    return _haar_pyramid(power) * (side / np.maximum.outer(scale, scale)) ** 2


def _seen(power: Floats, vertical: Floats, horizontal: Floats) -> Floats:
    """Variance of products of rows (A, H) and (B, W) with images whose cosines have this power."""
    tall, wide = (rows @ DICTIONARY.atoms(rows.shape[1]) for rows in (vertical, horizontal))
    return np.asarray(tall**2 @ power @ wide.T**2)


_ANY: dict[str, Callable[[Floats], Floats]] = {
    "cosine coefficients": lambda power: power,
    "Haar wavelet coefficients, axis by axis": _haar_of_axes,
}
_SQUARE: dict[str, Callable[[Floats], Floats]] = {
    "Haar wavelet coefficients, in a pyramid": _haar_pyramid,
    "Haar wavelet coefficients, in a pyramid of patterns of -1, 0 and 1": _haar_pyramid_of_signs,
}
