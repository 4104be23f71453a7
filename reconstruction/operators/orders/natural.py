"""The rows as their basis numbers them."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis


def natural(basis: Basis) -> NDArray[np.int64]:
    """All row numbers, ascending."""
    return np.arange(basis.rows)


ORDER = natural
