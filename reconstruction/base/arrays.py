"""Array types."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
Mask = NDArray[np.bool_]

#: Decorates entry points, whose numbers underflow harmlessly under a caller's `np.seterr("raise")`.
usual_float_errors = np.errstate(divide="warn", over="warn", under="ignore", invalid="warn")
