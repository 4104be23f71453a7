"""From readings to coefficients of an image, and how noisy these are."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..operators import Decoder, RowOperator
from .prior import Prior, fit_scale
from .shared_errors import without_shared_errors

MIN_ERROR = 1e-5
"""Least error of readings of patterns that are not orthogonal, over their spread: converters have
16 bits or so, and such patterns may tell some directions worse than that."""


@dataclass(frozen=True, eq=False)
class Coefficients:
    """``values`` (K,), which may be complex, and the standard deviation ``noise`` (K,) of each.

    That of complex ones is of both parts together. It is 0 where it is not known, and infinite
    where nothing was measured, as far as can be told; the value is then 0.
    """

    values: NDArray[Any]
    noise: Floats

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Where there is a measurement (K,)."""
        return np.isfinite(self.noise)


class CoefficientDecoder:
    """Decodes readings (M,), and takes off the errors that many coefficients share.

    ``prior`` makes what is known of the coefficients; of plans without shared readings, such as
    differential ones of orthogonal patterns, it is not asked.
    """

    def __init__(self, decoder: Decoder, prior: Callable[[], Prior]) -> None:
        self._decoder = decoder
        self._alike = isinstance(decoder.operator, RowOperator)  # all rows are
        self._columns = decoder.shared_columns()
        self._prior = prior() if self._columns.size or not self._alike else None

    def __call__(self, signal: NDArray[Any], variance: Floats) -> Coefficients:
        """Coefficients of one frame's ``signal`` (M,) with ``variance`` (M,), nan where unknown.

        An unknown variance is taken to be the median of the known ones. Where none is known, every
        reading is taken at its word.
        """
        values = self._decoder.decode(signal)
        known = np.isfinite(variance)
        if not self._alike:
            variance = np.fmax(variance, (MIN_ERROR * np.std(signal)) ** 2)
        elif not known.any():
            return Coefficients(values, np.zeros(values.size))
        elif not known.all():
            variance = np.where(known, variance, np.median(variance[known]))
        left = self._decoder.own_variance(variance)
        if self._columns.size:
            assert self._prior is not None
            values, left = without_shared_errors(
                self._columns,
                values,
                own=left,
                shared=variance[self._decoder.shared],
                prior=self._prior.variance(values),
            )
        if self._alike:
            return Coefficients(values, np.sqrt(np.full(left.shape, np.median(left))))
        return self._without_hidden(values, left)

    def _without_hidden(self, values: NDArray[Any], variance: Floats) -> Coefficients:
        """Coefficients less those that noise hides: it is larger than what images vary by."""
        assert self._prior is not None
        varying, expected = self._prior.varying, self._prior.expected
        scale = fit_scale(values[varying], expected, variance[varying])
        hidden = np.zeros(values.size, dtype=bool)
        hidden[varying] = variance[varying] > scale * expected
        return Coefficients(
            np.where(hidden, 0, values), np.where(hidden, np.inf, np.sqrt(variance))
        )
