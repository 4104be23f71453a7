"""Nested resolutions: each coarser image is complete before the next finer one begins."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, Counts, sign_changes
from ..hadamard import require_hadamard


def nested(basis: Basis) -> NDArray[np.int64]:
    """Row indices of a Hadamard basis; InputError for other bases.

    The first quarter are the rows of an image of half the sides, ordered the same way. Of the other
    quarters, detail along the image comes first, then detail down the image, then both, each sorted
    by number of blocks: M.-J. Sun et al., Sci. Rep. 7, 3464 (2017), for square images. Coarser
    images of other shapes keep the aspect ratio until a side is one pixel.
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
