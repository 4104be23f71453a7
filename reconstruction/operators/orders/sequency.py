"""Fewest sign changes along the row of length N first."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from ..hadamard import require_hadamard, sequency


def by_sequency(basis: Basis) -> NDArray[np.int64]:
    """Row indices of a Hadamard basis; InputError for other bases."""
    require_hadamard(basis, "sequency")
    return np.argsort(sequency(basis.rows))


ORDER = by_sequency
