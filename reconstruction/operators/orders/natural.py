"""Rows in the order of their basis."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis


def natural(basis: Basis) -> NDArray[np.int64]:
    """Row indices, ascending."""
    return np.arange(basis.rows)


ORDER = natural
