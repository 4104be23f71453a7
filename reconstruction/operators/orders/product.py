"""Smallest product of vertical and horizontal frequency first: a hyperbolic cross."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, sign_changes


def by_product(basis: Basis) -> NDArray[np.int64]:
    """Row indices, sorted by max(v, 1) max(h, 1), with v and h the sign changes down and along.

    The hyperbolic cross of D. Dung, V. Temlyakov and T. Ullrich, Hyperbolic Cross Approximation
    (2018), section 2.3; of all orders it extends farthest along the axes. Raises InputError for a
    basis whose rows have no sign changes.
    """
    vertical, horizontal = sign_changes(basis, "product")
    return np.argsort(np.maximum(vertical, 1) * np.maximum(horizontal, 1), kind="stable")


ORDER = by_product
