"""The DC row first, as it alone measures the brightness, then all others in random order."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from . import Seeded


def shuffled(basis: Basis, rng: np.random.Generator) -> NDArray[np.int64]:
    """Row indices of any basis."""
    rows = rng.permutation(basis.rows)
    return rows if basis.dc_row is None else np.append(basis.dc_row, rows[rows != basis.dc_row])


ORDER = Seeded(shuffled)
