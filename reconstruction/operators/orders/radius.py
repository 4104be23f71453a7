"""Lowest spatial frequency first: a growing circle."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, frequencies


def by_radius(basis: Basis) -> NDArray[np.int64]:
    """Row indices, sorted by (v / H)^2 + (h / W)^2, with v and h the sign changes down and along.

    The "circular path" of Z. Zhang et al., Opt. Express 25, 19619 (2017), section 2.3. Raises
    InputError for a basis whose rows have no sign changes.
    """
    vertical, horizontal = frequencies(basis, "radius")
    return np.argsort(vertical**2 + horizontal**2, kind="stable")


ORDER = by_radius
