"""The level, without which no brightness is known, then all others in random order."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from . import Seeded


def shuffled(basis: Basis, rng: np.random.Generator) -> NDArray[np.int64]:
    """All row numbers of any basis."""
    rows = rng.permutation(basis.rows)
    return rows if basis.level is None else np.append(basis.level, rows[rows != basis.level])


ORDER = Seeded(shuffled)
