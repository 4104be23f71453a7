"""Estimation of unknown noise from the readings.

Redundant readings measure the noise directly (`redundant_combinations`). Otherwise it is the white
part of the coefficients' power, as far as it cannot be the image: coefficients of images vary as
the prior expects, times individual factors with an inverse gamma distribution, so that they follow
Student's t distribution, with many small values among a few large ones; noise is Gaussian. A few
coefficients say little, as fine detail is as white as noise. What is white by pattern may be sparse
by place: the same coefficients, turned to differences of blocks (`localised`), follow a t
distribution with heavier tails. Both models have equal prior probability. Each of several `LEVELS`
of noise has a posterior probability, and image methods average over them (J. A. Hoeting et al.,
Stat. Sci. 14, 382 (1999)). The prior prefers weak noise, as recordings are made to be looked at
(`prior_of_levels`).
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import SparseRows
from .prior import SPREAD

MIN_COMBINATIONS = 8
"""Minimum number of combinations that measure the noise."""
MEDIAN_OF_NORMAL = 0.6745
"""Median magnitude of a standard normal variable."""


class Tails(NamedTuple):
    """Individual ``factors`` of variance of a t distribution with these degrees of freedom."""

    freedom: float
    first: int
    last: int

    @property
    def factors(self) -> Floats:
        """Factors (F,), powers of 4."""
        return 4.0 ** np.arange(self.first, self.last + 1, dtype=np.float64)


BY_PATTERN, BY_PLACE = Tails(3.0, -2, 2), Tails(1.0, -6, 3)
"""Tails of coefficients, and of differences of blocks, which are 0 where the image is flat."""
CONTRASTS = 4.0 ** np.arange(-7, 1.5, 0.5)
"""Signal variances, relative to the mean power of the coefficients."""
LEVELS = np.array([0.001, 0.01, 0.03, *np.arange(0.1, 1.15, 0.1)])
"""Standard deviations of the noise, relative to the rms of the coefficients."""
CLASSES = np.array([0.0, 0.25, 0.5, 0.75])
"""Lower limits of the classes into which noise levels are merged, each with its mean."""
UNLIKELY = 0.01
"""Probability below which a class is dropped."""


class NoiseLevels(NamedTuple):
    """Possible standard deviations ``sigma`` (J,) of noise, with their ``probability`` (J,)."""

    sigma: Floats
    probability: Floats

    @property
    def mean(self) -> float:
        """Mean standard deviation."""
        return float(self.sigma @ self.probability)

    @property
    def relative(self) -> "NoiseLevels":
        """Levels divided by their mean."""
        return NoiseLevels(self.sigma / self.mean, self.probability) if self.mean > 0 else CERTAIN

    def or_less(self, probability: float, others: "NoiseLevels") -> "NoiseLevels":
        """Mixture with ``others``, which are limited to the largest of these levels."""
        return NoiseLevels(
            np.append(self.sigma, np.minimum(others.sigma, self.sigma.max())),
            np.append(probability * self.probability, (1 - probability) * others.probability),
        )

    @property
    def and_one(self) -> "NoiseLevels":
        """Levels preceded by 1, with probability 0 if there are several."""
        if self.sigma.size == 1:
            return self
        return NoiseLevels(np.append(1.0, self.sigma), np.append(0.0, self.probability))


CERTAIN = NoiseLevels(np.ones(1), np.ones(1))
"""Relative level of noise that is known exactly."""


def variance_by_repetition(combinations: SparseRows, signal: NDArray[Any]) -> float | None:
    """Variance of a reading by the median of pure-noise combinations (D, M); None if too few."""
    if combinations.shape[0] < MIN_COMBINATIONS:
        return None
    return float(np.median(np.abs(combinations @ signal)) / MEDIAN_OF_NORMAL) ** 2


def levels_by_spectrum(
    measured: NDArray[Any],
    expected: Floats,
    contrast: float | None = None,
    turn: Floats | None = None,
) -> NoiseLevels:
    """Noise levels of coefficients (K,) of variance ``expected`` (K,) at the median contrast 1.

    ``turn`` (K, K): orthogonal matrix from differences of blocks to the coefficients, if any.
    """
    power = np.abs(measured) ** 2
    rms = float(np.sqrt(power.mean())) if power.size else 0.0
    if rms == 0:
        return NoiseLevels(np.zeros(1), np.ones(1))
    relative = expected / expected.mean()
    likelihoods = [_log_likelihood(power / rms**2, relative, BY_PATTERN)]
    if turn is not None:
        by_place = np.abs(measured @ turn) ** 2 / rms**2
        likelihoods.append(_log_likelihood(by_place, relative @ turn**2, BY_PLACE))
    likelihood = np.logaddexp.reduce(likelihoods)
    if contrast is not None:
        usual = contrast * expected.mean() / rms**2
        likelihood -= (np.log(CONTRASTS / usual) / (2 * SPREAD))[:, None] ** 2 / 2
    evidence = np.exp(likelihood - likelihood.max()).sum(axis=0)
    weight = evidence * prior_of_levels(LEVELS)
    of_class = np.searchsorted(CLASSES, LEVELS, side="right") - 1
    probability = np.bincount(of_class, weight) / weight.sum()
    sigma = np.bincount(of_class, weight * LEVELS) / np.maximum(
        np.bincount(of_class, weight), 1e-300
    )
    likely = probability > UNLIKELY
    if likely.sum() == 1 and evidence.argmax() == 0:
        return NoiseLevels(np.zeros(1), np.ones(1))
    return NoiseLevels(rms * sigma[likely], probability[likely] / probability[likely].sum())


def prior_of_levels(levels: Floats) -> Floats:
    """Prior of each level s up to a factor: the density of ln s is s^-1/2 above 0.01."""
    edges = np.sqrt(levels[1:] * levels[:-1])
    edges = np.concatenate([levels[:1], edges, levels[-1:]])
    return np.diff(np.log(edges)) * np.maximum(levels, 0.01) ** -0.5


def _log_likelihood(power: Floats, expected: Floats, tails: Tails) -> Floats:
    """Log likelihood of each of `CONTRASTS` combined with each of `LEVELS`."""
    each = np.outer(CONTRASTS, tails.factors).round(12)
    scales, index = np.unique(each, return_inverse=True)
    variance = scales[:, None, None] * expected + LEVELS[:, None] ** 2
    density = np.exp(-power / (2 * variance)) / np.sqrt(variance)
    mixed = np.einsum("f,cfvk->cvk", _weights(tails), density[index.reshape(each.shape)])
    return np.asarray(np.log(np.maximum(mixed, 1e-300)).sum(axis=-1))


@cache
def _weights(tails: Tails) -> Floats:
    """Probability of each factor, with edges between them from 0 to infinity."""
    from scipy.special import gammaincc  # slow to import

    factors, half = tails.factors, tails.freedom / 2
    edges = np.concatenate([[1e-300], np.sqrt(factors[1:] * factors[:-1]), [np.inf]])
    return np.asarray(np.diff(gammaincc(half, half / edges)))
