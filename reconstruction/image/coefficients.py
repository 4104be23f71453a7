"""From readings to coefficients of an image, and their noise.

A single-ended plan decodes to 2 y - all - dark: the errors of the all-on and the dark reading enter
every coefficient, and the inverse transform gathers them in one false pixel in the corner. The
error covariance of the coefficients is S V S^T + diag(own), with S the columns of the decoder that
belong to shared readings, V = diag(v) their variance, and ``own`` the variance due to all other
readings. A priori, coefficients are independent, of zero mean and variance ``prior``. With m = c +
S n + (own errors), the most probable shared errors n given m minimise

    sum_k w_k (m - S n)_k^2 + sum_j n_j^2 / v_j,    w = 1 / (prior + own),

so n = (S^T W S + V^-1)^-1 S^T W m. For a single number e common to all coefficients, e = sum(w m) /
(sum(w) + 1/v): it is determined by rows that hardly any image excites. The residual m - S n
contains own errors and those of n, of covariance (S^T W S + V^-1)^-1.

Where pairs of pattern and complement show that patterns pass more or less light than others, and
the plan does not state it, coefficients and their noise are divided by what the pairs show
(`Throughput.acting`).
"""

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

MIN_ERROR = 4e-6
"""Minimum error of readings of non-orthogonal patterns, relative to their spread: a step of a
16-bit converter has an rms error of 2^-16 / sqrt(12), and such patterns may amplify it."""
EQUAL_NOISE = 1.5
"""Ratio of the noise of two coefficients up to which pairs' throughput leaves weights equal: that
loses less than 4 % of the information, and a decomposition for equal noise serves all frames."""


@dataclass(frozen=True, eq=False)
class Coefficients:
    """Coefficients of one frame, with their noise.

    Parameters
    ----------
    values
        Coefficients (K,), real or complex; 0 where nothing was measured.
    noise
        Standard deviation (K,), of both parts together if complex; infinite where nothing was
        measured.
    levels
        Possible noise levels relative to ``noise``, if the noise is uncertain.
    """

    values: NDArray[Any]
    noise: Floats
    levels: NoiseLevels = CERTAIN

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Mask (K,) of the measured coefficients."""
        return np.isfinite(self.noise)

    def signal_over_noise(self, rows: NDArray[np.bool_]) -> float | None:
        """Noise-corrected rms of ``rows`` (K,) over their noise, at least one standard error."""
        valid = rows & self.measured & (self.noise > 0)
        if not valid.any():
            return None
        power = float(np.mean(np.abs(self.values[valid]) ** 2 / self.noise[valid] ** 2))
        return float(np.sqrt(max(power - 1, np.sqrt(2 / np.count_nonzero(rows)))))


class CoefficientDecoder:
    """Decodes readings (M,) and removes errors that many coefficients share.

    Parameters
    ----------
    decoder
        Decoder of the plan.
    prior
        Creates the prior of the coefficients; called only if needed.
    redundant
        Combinations (D, M) of readings that measure the noise if throughput is uniform.
    throughput
        Test whether it is, and estimator of what it is.
    drift
        Estimator of offset drift, or None.
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
        self._uniform = isinstance(decoder.operator, RowOperator)
        self._columns = decoder.shared_columns()
        self._make_prior = prior

    @cached_property
    def _prior(self) -> Prior:
        return self._make_prior()

    def __call__(
        self, signal: NDArray[Any], variance: Floats, usable: Mask | None = None
    ) -> Coefficients:
        """Decode one frame.

        Parameters
        ----------
        signal
            Readings (M,).
        variance
            Their variance (M,). Where it is nan, the median of the others is used; if all are nan,
            the noise is estimated from the readings.
        usable
            Mask (M,) of the readings to use, all by default. Coefficients that rest on others are
            not measured.
        """
        if self._drift is not None:
            signal = signal - self._drift(signal, usable)
        values = self._decoder.decode(signal)
        measured = None if usable is None else self._decoder.measured(usable)
        if measured is not None:
            values[~measured] = 0
        finite, levels, stated = np.isfinite(variance), CERTAIN, variance
        finite = finite if usable is None else finite & usable
        if not finite.any():
            estimated = self._estimated(signal, values, usable, measured)
            levels = estimated.relative
            variance = np.full(variance.shape, estimated.mean**2)
        elif not finite.all():
            variance = np.where(finite, variance, np.median(variance[finite]))
        if self._uniform:
            values, left = self._unshared(values, variance, measured)
            usual = self._decoder.operator.usual_noise
            level = left / usual**2
            noise = usual * np.sqrt(np.median(level if measured is None else level[measured]))
            gains = self._gains(signal, stated, usable)
            if gains is not None:
                values, noise = values * gains, weighed(np.sqrt(left) * gains, measured)
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
        """Coefficients without shared errors, 0 unless ``measured``, and the remaining variance."""
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

    def _gains(self, signal: NDArray[Any], variance: Floats, usable: Mask | None) -> Floats | None:
        """Factors (K,) that undo the throughput of the patterns; None if pairs show none."""
        factors = self._throughput.acting(signal, variance, usable)
        return None if factors is None else np.nan_to_num(1 / factors[self._decoder.index], nan=1.0)

    def _estimated(
        self, signal: NDArray[Any], values: NDArray[Any], usable: Mask | None, measured: Mask | None
    ) -> NoiseLevels:
        """Noise of each reading, estimated from the readings."""
        redundant = self._redundant
        if usable is not None:
            redundant = redundant.only(redundant.resting_on(usable))
        repeated_variance = variance_by_repetition(redundant, signal)
        if repeated_variance is not None:
            repeated = NoiseLevels(np.sqrt([repeated_variance]), np.ones(1))
            sure = self._throughput.probability_of_noise(signal, usable)
            if sure == 1:
                return repeated
            return repeated.or_less(sure, self._by_spectrum(values, measured))
        levels = self._by_spectrum(values, measured)
        if self._columns.size:  # shared errors look white, too
            values, _ = self._unshared(values, np.full(signal.shape, levels.mean**2), measured)
            levels = self._by_spectrum(values, measured)
        return levels

    def _by_spectrum(self, values: NDArray[Any], measured: Mask | None) -> NoiseLevels:
        varying, expected = self._prior.varying, self._prior.expected
        given = np.ones(expected.size, bool) if measured is None else measured[varying]
        if measured is not None:
            expected = expected[given]
            varying = varying & measured
        readings = self._decoder.matrix.shape[1]
        of_one = self._decoder.own_variance(np.ones(readings))[varying]
        length = self._decoder.operator.row_length
        scaled = values[varying] / np.sqrt(of_one)
        contrast = self._contrast(values, measured)
        turn = self._prior.localised(given)
        return levels_by_spectrum(scaled, expected * length**2 / of_one, contrast, turn)

    def _contrast(self, values: NDArray[Any], measured: Mask | None) -> float | None:
        """Typical contrast of images with this DC coefficient, None if it is not measured."""
        operator = self._decoder.operator
        if operator.dc_row is None or not operator.varying.any():
            return None
        if measured is not None and not measured[operator.dc_row]:
            return None
        mean = operator.dc_offset(values[operator.dc_row], np.zeros(operator.image_shape))
        return usual_contrast(abs(mean) ** 2, float((self._prior.sigma**2).mean())) or None


def weighed(noise: Floats, measured: Mask | None) -> Floats:
    """Noise (K,) for all ``measured`` coefficients: their median, unless it differs much."""
    some = noise if measured is None else noise[measured]
    if some.max() > EQUAL_NOISE * some.min():
        return noise
    return np.full(noise.shape, np.median(some))


def without_shared_errors(
    columns: Floats, coefficients: NDArray[Any], *, own: Floats, shared: Floats, prior: Floats
) -> tuple[NDArray[Any], Floats]:
    """Remove the most probable shared errors; see the module.

    Parameters
    ----------
    columns
        Contribution (K, S) of the shared readings to the coefficients.
    coefficients
        Coefficients (K,), real or complex; variances are of both parts together.
    own
        Variance (K,) due to all other readings.
    shared
        Variance (S,) of the shared readings.
    prior
        Prior variance (K,) of the coefficients, infinite if unknown.

    Returns
    -------
    tuple
        Corrected coefficients (K,), and the variance (K,) of their errors.
    """
    weighted = columns / (prior + own)[:, None]
    # Both sides times V: a reading without error, v = 0, is fine.
    system = np.eye(shared.size) + shared[:, None] * (columns.T @ weighted)
    inverse = np.linalg.inv(system)
    errors, covariance = inverse @ (shared * (weighted.T @ coefficients)), inverse * shared
    left = ((columns @ covariance) * columns).sum(axis=1)
    return coefficients - columns @ errors, own + left
