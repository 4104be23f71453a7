"""How much images vary, as far as their coefficients and their level tell.

Independent components of coefficients have variances v l_k + s_k^2. The contrast v is hardly told
where noise is the stronger part: its likelihood is nearly flat, and where it is highest says little
(often v = 0). So nothing is decided there: everything is averaged over v, each as probable as the
data make it. The exponent of the spectrum, by which the l_k differ from one scene to the next, is
treated alike. Before the coefficients are looked at,

* the rms contrast of an image over its mean is `RELATIVE`, give or take the factor e^`SPREAD`,
  where the mean is measured;
* otherwise the share of a component that is noise is as likely any number between 0 and 1
  (W. E. Strawderman, Ann. Math. Statist. 42, 385 (1971); M. J. Daniels, Can. J. Statist. 27, 567
  (1999)): wherever the data tell anything, this hardly matters.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients

RELATIVE, SPREAD = 0.5, 0.8
"""Median and logarithmic deviation of rms contrast over mean: scenes that tools/drawn_images.py
draws to learn from, in clear air and in fog."""
POINTS, ROUNDS = 12, 3
"""Contrasts in each round, of which the next looks closer at the likely ones."""
UNLIKELY = 8.0
"""Log-density below the highest that is not looked at more closely."""
LEAST = 1e-3
"""Least contrast that is looked at, over that at which the strongest component is half noise."""


class Contrasts(NamedTuple):
    """Contrasts ``value`` (J,) and the ``probability`` (E, J) of each with each of E spectra.

    ``given`` (E,): mean contrast, given each spectrum.
    """

    value: Floats
    probability: Floats
    given: Floats

    @property
    def mean(self) -> float:
        """Mean over all."""
        return float((self.probability @ self.value).sum())


class Shrunk(NamedTuple):
    """Components (K,) under all contrasts and spectra together, per measured one of each.

    ``gain``: the posterior mean over what was measured; ``variance``: of the posterior, by noise
    alone and between contrasts: the latter times the square of what was measured.
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
            units = np.eye(1, operator.shape[0], operator.level)
            self._mean = float(operator.least_energy(units[0]).mean())

    def __call__(self, coefficients: Coefficients) -> float | None:
        """The median v, None where the level is not measured."""
        if self._level is None or not coefficients.measured[self._level]:
            return None
        value, error = coefficients.values[self._level], coefficients.noise[self._level]
        square = float(abs(value) ** 2 + error**2) * self._mean**2
        return RELATIVE**2 * square / self._variance or None


def contrasts(
    measured: NDArray[Any], spreads: Floats, noise: Floats | float, expected: float | None
) -> Contrasts:
    """Posterior of v, of components (K,), not all 0, with noise of variance ``noise``.

    ``spreads`` (E, K): variances l, of each spectrum; ``expected``: median of v before, if told.
    """
    power = np.abs(measured) ** 2
    half = 1.0 if np.iscomplexobj(measured) else 0.5  # the densities of two numbers, or of one
    usual = spreads.mean(axis=0)
    seen = usual > 1e-12 * usual.max()
    noise = np.broadcast_to(noise, power.shape)[seen]
    power, spreads, usual = power[seen], spreads[:, seen], usual[seen]
    equal = float((noise / usual).min())  # half of the strongest component is noise
    most = max(float((power / usual).max()), equal)
    logs = np.linspace(np.log(LEAST * equal), np.log(10 * most), POINTS)
    for last in np.arange(ROUNDS) == ROUNDS - 1:
        variance = np.exp(logs)[:, None] * spreads[:, None, :] + noise
        density = -half * (np.log(variance) + power / variance).sum(axis=-1)
        density += _before(logs, equal, expected)
        if not last:
            likely = np.flatnonzero((density > density.max() - UNLIKELY).any(axis=0))
            low, high = max(likely[0] - 1, 0), min(likely[-1] + 1, POINTS - 1)
            logs = np.linspace(logs[low], logs[high], POINTS)
    values, weight = np.exp(logs), np.exp(density - density.max())
    alone = np.exp(density - density.max(axis=1, keepdims=True))
    own = alone @ values / alone.sum(axis=1)
    return Contrasts(values, weight / weight.sum(), own)


def _before(logs: Floats, equal: float, expected: float | None) -> Floats:
    """Log-density of logarithms of v before anything is measured."""
    if expected is not None:
        return -(((logs - np.log(expected)) / (2 * SPREAD)) ** 2) / 2
    size = logs - np.log(equal)
    return np.asarray(size - 2 * np.logaddexp(0, size))


def shrunk(known: Contrasts, spreads: Floats, noise: Floats | float) -> Shrunk:
    """Posterior of components with ``spreads`` (E, K) and noise of variance ``noise``."""
    signal = known.value[:, None] * spreads[:, None, :]
    gains = signal / (signal + noise)
    gain = np.einsum("ej,ejk->k", known.probability, gains)
    square = np.einsum("ej,ejk->k", known.probability, gains**2)
    return Shrunk(gain, gain * noise, np.maximum(square - gain**2, 0))
