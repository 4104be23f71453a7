"""Adapter for PyLops (https://pylops.readthedocs.io)."""

from typing import Any, cast

import pylops
from scipy.sparse.linalg import aslinearoperator

from ..operators import MeasurementOperator


def linear_operator(operator: MeasurementOperator) -> Any:
    """`pylops.LinearOperator` from flat images (N,) to coefficients (K,)."""
    result = pylops.LinearOperator(aslinearoperator(cast(Any, operator)))
    result.dims, result.dimsd = operator.image_shape, (operator.shape[0],)
    return result
