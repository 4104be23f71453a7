"""From readings to coefficients of an image, and how noisy these are."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..operators import Decoder, RowOperator
from .prior import Prior
from .shared_errors import without_shared_errors


@dataclass(frozen=True, eq=False)
class Coefficients:
    """``values`` (K,), which may be complex, and the standard deviation ``noise`` (K,) of each.

    That of complex ones is of both parts together; it is 0 where it is not known.
    """

    values: NDArray[Any]
    noise: Floats


class CoefficientDecoder:
    """Decodes readings (M,), and takes off the errors that many coefficients share.

    ``prior`` makes what is known of the coefficients; of plans without shared readings, such as
    differential ones, it is not asked.
    """

    def __init__(self, decoder: Decoder, prior: Callable[[], Prior]) -> None:
        self._decoder = decoder
        self._columns = decoder.shared_columns()
        self._prior = prior() if self._columns.size else None

    def __call__(self, signal: NDArray[Any], variance: Floats) -> Coefficients:
        """Coefficients of one frame's ``signal`` (M,) with ``variance`` (M,), nan where unknown.

        An unknown variance is taken to be the median of the known ones. Where none is known, every
        reading is taken at its word.
        """
        values = self._decoder.decode(signal)
        known = np.isfinite(variance)
        if not known.any():
            return Coefficients(values, np.zeros(values.size))
        variance = np.where(known, variance, np.median(variance[known]))
        left = self._decoder.own_variance(variance)
        if self._prior is not None:
            values, left = without_shared_errors(
                self._columns,
                values,
                own=left,
                shared=variance[self._decoder.shared],
                prior=self._prior.variance(values),
            )
        if isinstance(self._decoder.operator, RowOperator):  # whose rows are alike
            left = np.full(left.shape, np.median(left))
        return Coefficients(values, np.sqrt(left))
