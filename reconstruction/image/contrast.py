"""Posterior of the contrast of images, given their coefficients and their DC coefficient.

Independent components of coefficients have variances v l_k + s_k^2. Where noise dominates, the
contrast v is poorly determined: its likelihood is nearly flat, and its maximum means little (often
v = 0). Therefore everything is averaged over the posterior of v. The exponent of the spectrum,
which determines the l_k and differs between scenes, is treated likewise. The prior of v is:

* if the mean of the image is measured, the rms contrast over the mean has its typical value
(`prior`) within the factor e^`SPREAD`;
* otherwise, the noise fraction of a component is uniform between 0 and 1 (W. E. Strawderman, Ann.
Math. Statist. 42, 385 (1971); M. J. Daniels, Can. J. Statist. 27, 567 (1999)), which hardly matters
as soon as the data are informative.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients
from .noise import CERTAIN, NoiseLevels
from .prior import SPREAD, usual_contrast

POINTS, ROUNDS = 12, 3
"""Contrasts per round, and rounds; each round refines the grid around the likely ones."""
STEPS = np.linspace(0, 1, POINTS)
UNLIKELY = 8.0
"""Log density below the maximum at which a contrast is no longer refined."""
MIN_CONTRAST = 1e-3
"""Minimum contrast, relative to that at which the strongest component is half noise."""
MIN_VARIANCE = 1e-12
"""Minimum noise variance, relative to the mean power of the components."""


class Contrasts(NamedTuple):
    """Grid ``value`` and ``probability`` (L E, J) of L levels and E spectra, means ``given``."""

    value: Floats
    probability: Floats
    given: Floats

    @property
    def of_all(self) -> Floats:
        """Mean (...) over all spectra."""
        return np.asarray((self.probability * self.value).sum(axis=(-2, -1)))


class Shrunk(NamedTuple):
    """Posterior ``gain`` (K,); the variance is ``by_noise`` + ``between`` * squared measurement."""

    gain: Floats
    by_noise: Floats
    between: Floats


class ContrastByDc:
    """Prior median of the contrast by the DC coefficient; ``variance``: of pixels for v = 1."""

    def __init__(self, operator: MeasurementOperator, variance: float) -> None:
        self._dc_row = operator.dc_row
        self._variance = variance
        if operator.dc_row is not None:
            self._mean = float(operator.dc_offset(1.0, np.zeros(operator.image_shape)))

    def __call__(self, coefficients: Coefficients) -> float | None:
        """Median v, or None if the DC coefficient is not measured."""
        if self._dc_row is None or not coefficients.measured[self._dc_row]:
            return None
        value, error = coefficients.values[self._dc_row], coefficients.noise[self._dc_row]
        square = float(abs(value) ** 2 + error**2) * self._mean**2
        return usual_contrast(square, self._variance) or None


def contrasts(
    measured: NDArray[Any],
    spreads: Floats,
    noise: Floats | float,
    expected: float | None,
    levels: NoiseLevels = CERTAIN,
    usual: Floats | None = None,
    lost: Floats | None = None,
) -> Contrasts:
    """Posterior of v from components (K,), not all 0, with noise of variance ``noise``.

    ``spreads`` (E, K): variances l of each spectrum. ``expected``: prior median of v, if known.
    ``levels``: possible noise levels relative to ``noise``. ``usual`` (K,): variances that set the
    range of v, by default the mean of ``spreads``. ``lost`` (K, f): unmeasured combinations of the
    components, for uniform noise. A complex component counts as one number, as if the whole image
    had one phase.
    """
    prior = None if expected is None else np.array([expected])
    result = contrasts_of_frames(measured[None], spreads, noise, prior, levels, usual, lost)
    return Contrasts(*(each[0] for each in result))


def contrasts_of_frames(
    measured: NDArray[Any],
    spreads: Floats,
    noise: Floats | float,
    expected: Floats | None,
    levels: NoiseLevels = CERTAIN,
    usual: Floats | None = None,
    lost: Floats | None = None,
) -> Contrasts:
    """`contrasts` of components (F, K) of several frames; results have a leading frame axis."""
    usual = spreads.mean(axis=0) if usual is None else usual
    seen = usual > 1e-12 * usual.max()
    power = np.abs(measured) ** 2
    frames, count = power.shape
    min_noise = MIN_VARIANCE * (power.sum(axis=1, keepdims=True) / count)
    variances = np.maximum(np.broadcast_to(noise, power.shape), min_noise)
    times = np.repeat(np.maximum(levels.sigma, MIN_VARIANCE) ** 2, len(spreads))
    # At contrast ``equal`` (F, L E, 1), half of the strongest component is noise.
    equal = (variances[:, seen] / usual[seen]).min(axis=1)[:, None, None] * times[:, None]
    maximum = np.maximum((power[:, seen] / usual[seen]).max(axis=1)[:, None, None], equal)
    expected = None if expected is None else expected[:, None, None]
    minimum = MIN_CONTRAST * equal if expected is None else expected * np.exp(-6 * SPREAD)
    low, high = np.log(np.minimum(minimum, MIN_CONTRAST * equal)), np.log(10 * maximum)
    logs = low + (high - low) * STEPS  # (F, L E, J)
    signal = spreads.T[:, None] / variances.T[..., None]
    signal = np.concatenate([signal] * levels.sigma.size, axis=-1) / times
    signal = np.repeat(signal.reshape(count, -1), POINTS, axis=1)  # (K, F L E J)
    power /= variances
    missing = None if lost is None else _Missing(measured[0] / np.sqrt(variances[0]), lost)
    for last in np.arange(ROUNDS) == ROUNDS - 1:
        variance = np.exp(logs).ravel() * signal  # relative to the noise
        variance += 1
        precision = 1 / variance
        misfit = power[:, None] @ precision.reshape(count, frames, -1).swapaxes(0, 1)
        misfit, volume = misfit.ravel(), _sum_of_logs(variance)
        if missing is not None:
            explained, log_determinant = missing(precision)
            misfit, volume = misfit - explained, volume + log_determinant
        misfit = misfit.reshape(logs.shape) / times[:, None]
        density = -(volume.reshape(logs.shape) + misfit) / 2
        density += (
            _log_prior(logs, expected)
            if expected is not None
            else _log_prior_without_dc(logs, equal)
        )
        if not last:
            logs = _closer(logs, density)
    weight = np.exp(density - density.max(axis=-1, keepdims=True))
    values = np.exp(logs)
    given = (weight * values).sum(axis=-1) / weight.sum(axis=-1)
    density = density.reshape(frames, levels.sigma.size, -1)
    weight = np.exp(density - density.max(axis=-1, keepdims=True)).reshape(logs.shape)
    weight = (weight * (logs[..., 1:2] - logs[..., :1])).reshape(density.shape)
    weight *= levels.probability[:, None] / weight.sum(axis=-1, keepdims=True)
    return Contrasts(values, weight.reshape(logs.shape), given)


class _Missing:
    """Corrections for unmeasured combinations ``lost`` (K, f) of components, in units of noise."""

    def __init__(self, measured: NDArray[Any], lost: Floats) -> None:
        self._count = lost.shape[1]
        self._squares = (lost[:, :, None] * lost[:, None]).reshape(len(lost), -1).T
        self._seen = (lost * measured[:, None]).T

    def __call__(self, precision: Floats) -> tuple[Floats, Floats]:
        """Their contributions to chi squared and log volume (n,), for precisions (K, n)."""
        matrix = (self._squares @ precision).T.reshape(-1, self._count, self._count)
        seen = (self._seen @ precision).T[..., None]
        explained = (np.conj(seen) * np.linalg.solve(matrix, seen)).real.sum(axis=(1, 2))
        return explained, np.linalg.slogdet(matrix)[1]


def _sum_of_logs(values: Floats) -> Floats:
    """Sum of logarithms along the first axis, for numbers in 1..1e30."""
    products = np.multiply.reduceat(values, np.arange(0, len(values), 8), axis=0)
    return np.asarray(np.log(products).sum(axis=0))


def _closer(logs: Floats, density: Floats) -> Floats:
    """Refined grid (..., J) around the likely contrasts of each spectrum."""
    likely = density > density.max(axis=-1, keepdims=True) - UNLIKELY
    first = np.maximum(likely.argmax(axis=-1) - 1, 0)
    last = np.minimum(POINTS - likely[..., ::-1].argmax(axis=-1), POINTS - 1)
    low, high = (np.take_along_axis(logs, at[..., None], axis=-1) for at in (first, last))
    return low + (high - low) * STEPS


def _log_prior(logs: Floats, expected: Floats) -> Floats:
    """Log prior density of log v, given its median."""
    return np.asarray(-(((logs - np.log(expected)) / (2 * SPREAD)) ** 2) / 2)


def _log_prior_without_dc(logs: Floats, equal: Floats) -> Floats:
    """Log prior density of log v if no DC coefficient is measured."""
    size = logs - np.log(equal)
    return np.asarray(size - 2 * np.logaddexp(0, size))


def shrunk(
    given: Contrasts, spreads: Floats, noise: Floats | float, levels: NoiseLevels = CERTAIN
) -> Shrunk:
    """Shrinkage of components with ``spreads`` (E, K) and noise of variance ``noise``."""
    noise = np.repeat(levels.sigma**2, len(spreads))[:, None, None] * noise
    signal = given.value[..., None] * np.concatenate([spreads] * levels.sigma.size)[:, None]
    gains = signal / (signal + noise)
    weighted = given.probability[..., None] * gains
    gain = weighted.sum(axis=(-3, -2))
    square = np.einsum("...ejk,...ejk->...k", weighted, gains)
    by_noise = (weighted * noise).sum(axis=(-3, -2))
    return Shrunk(gain, by_noise, np.maximum(square - gain**2, 0))
