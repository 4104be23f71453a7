"""From readings to coefficients of an image, and how noisy these are."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..operators import Decoder, Drift, RowOperator, SparseRows, Throughput
from .noise import CERTAIN, NoiseLevels, levels_by_spectrum, variance_by_repetition
from .prior import Prior, usual_contrast
from .shared_errors import without_shared_errors

MIN_ERROR = 4e-6
"""Least error of readings of patterns that are not orthogonal, over their spread: converters have
16 bits or so, of which a step errs by 2^-16 / sqrt(12) rms, and such patterns may tell some
directions worse than that."""


@dataclass(frozen=True, eq=False)
class Coefficients:
    """``values`` (K,), which may be complex, and the standard deviation ``noise`` (K,) of each.

    That of complex ones is of both parts together. It is infinite where nothing was measured, as
    far as can be told; the value is then 0. Where noise is not sure, ``levels`` are what it may be,
    over ``noise``.
    """

    values: NDArray[Any]
    noise: Floats
    levels: NoiseLevels = CERTAIN

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Where there is a measurement (K,)."""
        return np.isfinite(self.noise)

    def signal_over_noise(self, rows: NDArray[np.bool_]) -> float | None:
        """Rms of those of some ``rows`` (K,), without their noise, over that noise.

        At least what may be noise by chance, one standard error; None where there is no noise.
        """
        valid = rows & self.measured & (self.noise > 0)
        if not valid.any():
            return None
        power = float(np.mean(np.abs(self.values[valid]) ** 2 / self.noise[valid] ** 2))
        return float(np.sqrt(max(power - 1, np.sqrt(2 / np.count_nonzero(rows)))))


class CoefficientDecoder:
    """Decodes readings (M,), and takes off the errors that many coefficients share.

    ``prior`` makes what is known of the coefficients; it is not asked where it is not needed.
    ``redundant`` are the combinations of readings that tell their noise, as far as ``throughput``
    is the same for all patterns; ``drift`` tells how their offset drifts, where anything does.
    """

    def __init__(
        self,
        decoder: Decoder,
        prior: Callable[[], Prior],
        redundant: SparseRows,
        throughput: Throughput,
        drift: Drift | None,
    ) -> None:
        self._decoder = decoder
        self._drift = drift
        self._redundant = redundant
        self._throughput = throughput
        self._alike = isinstance(decoder.operator, RowOperator)  # all rows are
        self._columns = decoder.shared_columns()
        self._make_prior = prior

    @cached_property
    def _prior(self) -> Prior:
        return self._make_prior()

    def __call__(
        self, signal: NDArray[Any], variance: Floats, usable: Mask | None = None
    ) -> Coefficients:
        """Coefficients of one frame's ``signal`` (M,) with ``variance`` (M,), nan where unknown.

        Those that do not rest on ``usable`` (M,) readings alone are not measured; all are if None.
        An unknown variance is taken to be the median of the known ones; where none is known it is
        estimated.
        """
        if self._drift is not None:
            signal = signal - self._drift(signal, usable)
        values = self._decoder.decode(signal)
        measured = None if usable is None else self._decoder.measured(usable)
        if measured is not None:
            values[~measured] = 0
        given, levels = np.isfinite(variance), CERTAIN
        given = given if usable is None else given & usable
        if not given.any():
            estimated = self._estimated(signal, values, usable, measured)
            levels = estimated.relative
            variance = np.full(variance.shape, estimated.mean**2)
        elif not given.all():
            variance = np.where(given, variance, np.median(variance[given]))
        if self._alike:
            values, left = self._unshared(values, variance, measured)
            noise = np.full(
                left.shape, np.sqrt(np.median(left if measured is None else left[measured]))
            )
        else:
            minimum = (MIN_ERROR * float(np.std(signal))) ** 2
            equal = max(float(np.mean(variance)), minimum)
            noise = np.sqrt(equal) * self._decoder.operator.usual_noise
        if measured is not None:
            noise[~measured] = np.inf
        return Coefficients(values, noise, levels)

    def _unshared(
        self, values: NDArray[Any], variance: Floats, measured: Mask | None
    ) -> tuple[NDArray[Any], Floats]:
        """Coefficients without the errors that they share, and the variance of the rest.

        Those that are not ``measured`` tell nothing, and stay 0.
        """
        own = self._decoder.own_variance(variance)
        if not self._columns.size:
            return values, own
        shared, prior = variance[self._decoder.shared], self._prior.variance(values, measured)
        if measured is not None:
            prior = np.where(measured, prior, np.inf)
        values, left = without_shared_errors(
            self._columns, values, own=own, shared=shared, prior=prior
        )
        if measured is not None:
            values[~measured] = 0
        return values, left

    def _estimated(
        self,
        signal: NDArray[Any],
        values: NDArray[Any],
        usable: Mask | None,
        measured: Mask | None,
    ) -> NoiseLevels:
        """Noise of each reading, where nothing is known of it."""
        redundant = self._redundant
        if usable is not None:
            redundant = redundant.only(redundant.resting_on(usable))
        reported = variance_by_repetition(redundant, signal)
        if reported is not None:
            repeated = NoiseLevels(np.sqrt([reported]), np.ones(1))
            sure = self._throughput.probability_of_noise(signal, usable)
            if sure == 1:
                return repeated
            return repeated.or_less(sure, self._by_spectrum(values, measured))
        levels = self._by_spectrum(values, measured)
        if self._columns.size:  # what all share looks white, too
            values, _ = self._unshared(values, np.full(signal.shape, levels.mean**2), measured)
            levels = self._by_spectrum(values, measured)
        return levels

    def _by_spectrum(self, values: NDArray[Any], measured: Mask | None) -> NoiseLevels:
        varying, expected = self._prior.varying, self._prior.expected
        if measured is not None:
            expected = expected[measured[varying]]
            varying = varying & measured
        readings = self._decoder.matrix.shape[1]
        of_one = self._decoder.own_variance(np.ones(readings))[varying]
        length = self._decoder.operator.row_length
        scaled = values[varying] / np.sqrt(of_one)
        contrast = self._contrast(values, measured)
        return levels_by_spectrum(scaled, expected * length**2 / of_one, contrast)

    def _contrast(self, values: NDArray[Any], measured: Mask | None) -> float | None:
        """The usual contrast of images of this level, None where it is not measured."""
        operator = self._decoder.operator
        if operator.level is None or not operator.varying.any():
            return None
        if measured is not None and not measured[operator.level]:
            return None
        mean = operator.mean_dc(values[operator.level], np.zeros(operator.image_shape))
        return usual_contrast(abs(mean) ** 2, float((self._prior.sigma**2).mean())) or None
