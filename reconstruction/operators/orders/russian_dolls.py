"""Every coarser image complete before the next finer one begins."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from ..hadamard import require_hadamard
from ..sign_changes import Counts, sign_changes


def nested(basis: Basis) -> NDArray[np.int64]:
    """All row numbers of a Hadamard basis; InputError for another basis.

    The first quarter are the rows of an image of half the sides, and so on within it. Of the other
    quarters first comes that of fine detail along the image alone, then its transpose, then that of
    detail both ways, each by its number of blocks: M.-J. Sun et al., Sci. Rep. 7, 3464 (2017), who
    have square images. The coarser images of another have its aspect ratio, as long as their sides
    have pixels left to halve.
    """
    require_hadamard(basis, "russian-dolls")
    vertical, horizontal = sign_changes(basis, "russian-dolls")
    sides = [int(side).bit_length() for side in basis.shape]
    down, along = (
        np.where(changes, _digits(changes) + max(sides) - side, 0)
        for changes, side in zip((vertical, horizontal), sides, strict=True)
    )
    level = np.maximum(down, along)
    quarter = 2 * (down == level) + (along == level)  # 1 along alone, 2 down alone, 3 both
    blocks = (vertical + 1) * (horizontal + 1)
    return np.lexsort((blocks, quarter, level))


def _digits(numbers: Counts) -> Counts:
    """Number of binary digits."""
    return np.frexp(numbers.astype(np.float64))[1].astype(np.int64)


ORDER = nested
