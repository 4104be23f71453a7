"""Patterns with the fewest connected blocks first."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, sign_changes
from ..hadamard import require_hadamard


def by_blocks(basis: Basis) -> NDArray[np.int64]:
    """Row indices of a Hadamard basis, sorted by number of blocks; InputError for other bases.

    A block is a connected set of pixels of one sign. A row is an outer product, so v sign changes
    down and h along the image cut it into (v + 1) (h + 1) rectangles, each of which is a block.
    W.-K. Yu, Sensors 19, 4122 (2019), counts the blocks in the pattern.
    """
    require_hadamard(basis, "cake-cutting")
    vertical, horizontal = sign_changes(basis, "cake-cutting")
    return np.argsort((vertical + 1) * (horizontal + 1), kind="stable")


ORDER = by_blocks
