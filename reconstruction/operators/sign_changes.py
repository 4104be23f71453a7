"""How often the rows of a basis change sign across the image: what most orders go by."""

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .basis import Basis

Counts = NDArray[np.int64]


def sign_changes(basis: Basis, order: str) -> tuple[Counts, Counts]:
    """Sign changes of every row, (rows,) each: down a column of the image, and along a row of it.

    Raises InputError, naming the ``order`` that asks, for a basis whose rows have no such numbers.
    """
    if basis.sign_changes is None:
        raise InputError(
            f"order {order!r} goes by sign changes, which rows of the basis {basis.name!r} do not "
            "tell: use natural"
        )
    return basis.sign_changes


def frequencies(basis: Basis, order: str) -> tuple[Floats, Floats]:
    """The same over the pixels of the side: twice the spatial frequency in cycles per pixel."""
    vertical, horizontal = sign_changes(basis, order)
    height, width = basis.shape
    return vertical / height, horizontal / width
