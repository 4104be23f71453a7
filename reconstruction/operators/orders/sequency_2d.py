"""Smallest sum of vertical and horizontal spatial frequency first."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from ..hadamard import require_hadamard, sequency


def by_frequency(basis: Basis) -> NDArray[np.int64]:
    """All row numbers of a Hadamard basis; InputError for another basis."""
    require_hadamard(basis, "sequency-2d")
    height, width = basis.shape
    # A row with s sign changes over n pixels oscillates with s / 2n cycles per pixel.
    vertical, horizontal = sequency(height) / height, sequency(width) / width
    return np.argsort(np.add.outer(vertical, horizontal).ravel(), kind="stable")


ORDER = by_frequency
