"""Line by line through the square of vertical and horizontal sequency."""

import numpy as np
from numpy.typing import NDArray

from ..basis import Basis
from ..hadamard import require_hadamard
from ..sign_changes import sign_changes


def by_lines(basis: Basis) -> NDArray[np.int64]:
    """All row numbers of a Hadamard basis, by v W + h, v and h sign changes down and along.

    The rows of the separable two-dimensional Walsh transform, the Kronecker product of a matrix in
    sequency order for either side: W. K. Pratt, J. Kane and H. C. Andrews, Proc. IEEE 57, 58
    (1969). InputError for another basis.
    """
    require_hadamard(basis, "walsh-2d")
    vertical, horizontal = sign_changes(basis, "walsh-2d")
    return np.argsort(vertical * basis.shape[1] + horizontal)


ORDER = by_lines
