"""Along the diagonals of the frequency plane, back and forth, as in JPEG."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, sign_changes


def along_diagonals(basis: Basis) -> NDArray[np.int64]:
    """Row indices, by diagonals of the ranks of vertical and horizontal frequency.

    Ranks count the distinct numbers of sign changes, from 0: the first diagonals are (0, 0); (0,
    1), (1, 0); (2, 0), (1, 1), (0, 2) in terms of (down, along). G. K. Wallace, Commun. ACM 34(4),
    30 (1991); for Hadamard rows L. Lopez-Garcia et al., Opt. Express 30, 13714 (2022). Raises
    InputError for a basis whose rows have no sign changes.
    """
    vertical, horizontal = (
        np.unique(changes, return_inverse=True)[1] for changes in sign_changes(basis, "zig-zag")
    )
    diagonal = vertical + horizontal
    return np.lexsort((np.where(diagonal % 2, vertical, -vertical), diagonal))


ORDER = along_diagonals
