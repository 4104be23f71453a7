"""Line by line through the square of vertical and horizontal sequency."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis, sign_changes
from ..hadamard import require_hadamard


def by_lines(basis: Basis) -> NDArray[np.int64]:
    """Row indices of a Hadamard basis, sorted by v W + h, the sign changes down and along.

    The rows of the separable two-dimensional Walsh transform, the Kronecker product of two matrices
    in sequency order: W. K. Pratt, J. Kane and H. C. Andrews, Proc. IEEE 57, 58 (1969). Raises
    InputError for other bases.
    """
    require_hadamard(basis, "walsh-2d")
    vertical, horizontal = sign_changes(basis, "walsh-2d")
    return np.argsort(vertical * basis.shape[1] + horizontal)


ORDER = by_lines
