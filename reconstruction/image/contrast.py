"""How much images vary, as far as their coefficients and their level tell.

Independent components of coefficients have variances v l_k + s_k^2. The contrast v is hardly told
where noise is the stronger part: its likelihood is nearly flat, and where it is highest says little
(often v = 0). So nothing is decided there: everything is averaged over v, each as probable as the
data make it. The exponent of the spectrum, by which the l_k differ from one scene to the next, is
treated alike. Before the coefficients are looked at,

* the rms contrast of an image over its mean is the usual one (`prior`), give or take the factor
  e^`SPREAD`, where the mean is measured;
* otherwise the share of a component that is noise is as likely any number between 0 and 1
  (W. E. Strawderman, Ann. Math. Statist. 42, 385 (1971); M. J. Daniels, Can. J. Statist. 27, 567
  (1999)): wherever the data tell anything, this hardly matters.
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
"""Contrasts in each round, of which the next looks closer at the likely ones."""
STEPS = np.linspace(0, 1, POINTS)
UNLIKELY = 8.0
"""Log-density below the highest that is not looked at more closely."""
MIN = 1e-3
"""Least contrast that is looked at, over that at which the strongest component is half noise."""
NOISELESS = 1e-12
"""Least variance of noise over the mean power of components."""


class Contrasts(NamedTuple):
    """Contrasts ``value`` (L E, J) of each of E spectra, and their ``probability`` (L E, J).

    Those of each of L levels of noise follow each other. ``given`` (L E,): mean contrast, given
    each spectrum and level.
    """

    value: Floats
    probability: Floats
    given: Floats


class Shrunk(NamedTuple):
    """Of components (K,), over all contrasts and spectra.

    ``gain``: posterior mean over what was measured. The variance is ``by_noise``, and ``between``
    contrasts and spectra times the square of what was measured.
    """

    gain: Floats
    by_noise: Floats
    between: Floats


class ContrastByLevel:
    """What the level of an image tells of its contrast before anything else is looked at.

    ``variance``: mean variance of pixels of images of v = 1.
    """

    def __init__(self, operator: MeasurementOperator, variance: float) -> None:
        self._level = operator.level
        self._variance = variance
        if operator.level is not None:
            self._mean = float(operator.mean_dc(1.0, np.zeros(operator.image_shape)))

    def __call__(self, coefficients: Coefficients) -> float | None:
        """The median v, None where the level is not measured."""
        if self._level is None or not coefficients.measured[self._level]:
            return None
        value, error = coefficients.values[self._level], coefficients.noise[self._level]
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
    """Posterior of v, of components (K,), not all 0, with noise of variance ``noise``.

    ``spreads`` (E, K): variances l, of each spectrum; ``expected``: median of v before, if told;
    ``levels``: what the standard deviation may be, over that of ``noise``; ``usual`` (K,): the
    variances by which contrasts are looked for, the mean of ``spreads`` if None. Where noise is
    equal, ``lost`` (K, f) are combinations of the components of which nothing is known.
    A complex component counts as one number, as if all of the image had one phase.
    """
    reported = None if expected is None else np.array([expected])
    result = contrasts_of_frames(measured[None], spreads, noise, reported, levels, usual, lost)
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
    """The same of components (F, K) of several frames: each result has an axis of frames before.

    ``noise`` is to be broadcast to (F, K), ``expected`` (F,); ``lost`` are of one frame alone.
    """
    usual = spreads.mean(axis=0) if usual is None else usual
    seen = usual > 1e-12 * usual.max()
    power = np.abs(measured) ** 2
    frames, count = power.shape
    min_noise = NOISELESS * (power.sum(axis=1, keepdims=True) / count)
    variances = np.maximum(np.broadcast_to(noise, power.shape), min_noise)
    times = np.repeat(np.maximum(levels.sigma, NOISELESS) ** 2, len(spreads))
    # At ``equal`` (F, L E, 1) half of the strongest component is noise.
    equal = (variances[:, seen] / usual[seen]).min(axis=1)[:, None, None] * times[:, None]
    maximum = np.maximum((power[:, seen] / usual[seen]).max(axis=1)[:, None, None], equal)
    expected = None if expected is None else expected[:, None, None]
    minimum = MIN * equal if expected is None else expected * np.exp(-6 * SPREAD)
    low, high = np.log(np.minimum(minimum, MIN * equal)), np.log(10 * maximum)
    logs = low + (high - low) * STEPS  # (F, L E, J)
    signal = spreads.T[:, None] / variances.T[..., None]
    signal = np.concatenate([signal] * levels.sigma.size, axis=-1) / times
    signal = np.repeat(signal.reshape(count, -1), POINTS, axis=1)  # (K, F L E J)
    power /= variances
    missing = None if lost is None else _Missing(measured[0] / np.sqrt(variances[0]), lost)
    for last in np.arange(ROUNDS) == ROUNDS - 1:
        variance = np.exp(logs).ravel() * signal  # over that of noise
        variance += 1
        precision = 1 / variance
        misfit = power[:, None] @ precision.reshape(count, frames, -1).swapaxes(0, 1)
        misfit, volume = misfit.ravel(), _sum_of_logs(variance)
        if missing is not None:
            explained, log_determinant = missing(precision)
            misfit, volume = misfit - explained, volume + log_determinant
        misfit = misfit.reshape(logs.shape) / times[:, None]
        density = -(volume.reshape(logs.shape) + misfit) / 2
        density += _reported(logs, expected) if expected is not None else _untold(logs, equal)
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
    """What likelihoods of components (K,) lack where combinations ``lost`` (K, f) are not known.

    Both are over the noise, which is equal.
    """

    def __init__(self, measured: NDArray[Any], lost: Floats) -> None:
        self._count = lost.shape[1]
        self._squares = (lost[:, :, None] * lost[:, None]).reshape(len(lost), -1).T
        self._seen = (lost * measured[:, None]).T

    def __call__(self, precision: Floats) -> tuple[Floats, Floats]:
        """Chi squared and volume (n,) that they account for, of precisions (K, n)."""
        matrix = (self._squares @ precision).T.reshape(-1, self._count, self._count)
        seen = (self._seen @ precision).T[..., None]
        explained = (np.conj(seen) * np.linalg.solve(matrix, seen)).real.sum(axis=(1, 2))
        return explained, np.linalg.slogdet(matrix)[1]


def _sum_of_logs(values: Floats) -> Floats:
    """Along the first axis, of numbers from 1 to 1e30: products of eight take fewer logarithms."""
    products = np.multiply.reduceat(values, np.arange(0, len(values), 8), axis=0)
    return np.asarray(np.log(products).sum(axis=0))


def _closer(logs: Floats, density: Floats) -> Floats:
    """As many logarithms (..., J) about the likely ones of each spectrum."""
    likely = density > density.max(axis=-1, keepdims=True) - UNLIKELY
    first = np.maximum(likely.argmax(axis=-1) - 1, 0)
    last = np.minimum(POINTS - likely[..., ::-1].argmax(axis=-1), POINTS - 1)
    low, high = (np.take_along_axis(logs, at[..., None], axis=-1) for at in (first, last))
    return low + (high - low) * STEPS


def _reported(logs: Floats, expected: Floats) -> Floats:
    """Log-density of logarithms of v before anything but the level is measured."""
    return np.asarray(-(((logs - np.log(expected)) / (2 * SPREAD)) ** 2) / 2)


def _untold(logs: Floats, equal: Floats) -> Floats:
    """The same where not even that is."""
    size = logs - np.log(equal)
    return np.asarray(size - 2 * np.logaddexp(0, size))


def shrunk(
    given: Contrasts, spreads: Floats, noise: Floats | float, levels: NoiseLevels = CERTAIN
) -> Shrunk:
    """Posterior of components with ``spreads`` (E, K) and noise of variance ``noise``.

    ``levels``: as for `contrasts`. Of several frames, ``noise`` is (F, 1, 1, 1).
    """
    noise = np.repeat(levels.sigma**2, len(spreads))[:, None, None] * noise
    signal = given.value[..., None] * np.concatenate([spreads] * levels.sigma.size)[:, None]
    gains = signal / (signal + noise)
    weighted = given.probability[..., None] * gains
    gain = weighted.sum(axis=(-3, -2))
    square = np.einsum("...ejk,...ejk->...k", weighted, gains)
    by_noise = (weighted * noise).sum(axis=(-3, -2))
    return Shrunk(gain, by_noise, np.maximum(square - gain**2, 0))
