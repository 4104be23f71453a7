"""Smallest sum of vertical and horizontal spatial frequency first."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, frequencies


def by_sum(basis: Basis) -> NDArray[np.int64]:
    """Row indices, sorted by v / H + h / W, with v and h the sign changes down and along.

    Also known as the order of total variation, which is 2 (v W + h H) of such a row: W.-K. Yu and
    Y.-M. Liu, Sensors 19, 5135 (2019); W.-K. Yu et al., Sci. Rep. 10, 9338 (2020). Raises
    InputError for a basis whose rows have no sign changes.
    """
    vertical, horizontal = frequencies(basis, "sequency-2d")
    return np.argsort(vertical + horizontal, kind="stable")


ORDER = by_sum
