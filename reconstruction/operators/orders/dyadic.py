"""Paley's order: products of Rademacher functions, by binary digits."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from ..hadamard import require_hadamard


def by_digits(basis: Basis) -> NDArray[np.int64]:
    """Bit-reversed row indices of a Hadamard basis; InputError for other bases.

    Pattern n is the product of the Rademacher functions r_(i+1) over all bits i of n that are set,
    where r_i changes sign 2^i - 1 times along the row of length N: R. E. A. C. Paley, Proc. London
    Math. Soc. 34, 241 (1932).
    """
    require_hadamard(basis, "dyadic")
    bits = basis.rows.bit_length() - 1
    numbers = np.arange(basis.rows)
    rows = np.zeros_like(numbers)
    for bit in range(bits):
        rows |= ((numbers >> bit) & 1) << (bits - 1 - bit)
    return rows


ORDER = by_digits
