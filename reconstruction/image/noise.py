"""Noise that a recording does not tell, from its readings.

What is shown twice tells it by itself (`redundant_combinations`). Otherwise it is the white part of
the coefficients' power, as far as it cannot be the image: coefficients of images vary as the prior
expects, times factors of their own with an inverse gamma distribution, so that they are of
Student's t distribution, with many small values among few large ones; noise is Gaussian. Of few
coefficients this tells little: fine detail is as white as noise is. So nothing is decided: each of
some `LEVELS` of noise has the probability that the coefficients give it, and whoever makes an image
takes the mean over them (J. A. Hoeting et al., Stat. Sci. 14, 382 (1999)). Beforehand weak noise is
likelier than strong, as recordings are made to be looked at (`weigh`).
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import SparseRows
from .prior import SPREAD

FEWEST = 8
"""Combinations that tell the noise by themselves."""
MEDIAN_OF_NORMAL = 0.6745
"""Median of the magnitude of a normal variable of variance 1."""
FREEDOM = 3.0
"""Degrees of freedom of the t distribution."""
FACTORS = 4.0 ** np.arange(-2, 3)
"""Factors of the variance."""
CONTRASTS = 4.0 ** np.arange(-7, 1.5, 0.5)
"""Variances of signal over the mean power of the coefficients."""
LEVELS = np.array([0.001, 0.01, 0.03, *np.arange(0.1, 1.15, 0.1)])
"""Standard deviations of noise over the rms of the coefficients."""
CLASSES = np.array([0.0, 0.25, 0.5, 0.75])
"""Lower limits of these that are told apart, the others by their mean."""
UNLIKELY = 0.01
"""Probability of a class that is not looked at."""


class NoiseLevels(NamedTuple):
    """Standard deviations ``sigma`` (J,) that noise may have, with their ``probability`` (J,)."""

    sigma: Floats
    probability: Floats

    @property
    def mean(self) -> float:
        """The mean standard deviation."""
        return float(self.sigma @ self.probability)

    @property
    def relative(self) -> "NoiseLevels":
        """The same over the mean."""
        return NoiseLevels(self.sigma / self.mean, self.probability) if self.mean > 0 else CERTAIN

    def or_less(self, probability: float, others: "NoiseLevels") -> "NoiseLevels":
        """These with a ``probability``, or ``others`` as far as they are not larger."""
        return NoiseLevels(
            np.append(self.sigma, np.minimum(others.sigma, self.sigma.max())),
            np.append(probability * self.probability, (1 - probability) * others.probability),
        )

    @property
    def and_one(self) -> "NoiseLevels":
        """The same with 1 as the first, of no probability of its own where there are others."""
        if self.sigma.size == 1:
            return self
        return NoiseLevels(np.append(1.0, self.sigma), np.append(0.0, self.probability))


CERTAIN = NoiseLevels(np.ones(1), np.ones(1))
"""Noise, over itself, of which nothing is unsure."""


def variance_by_repetition(combinations: SparseRows, signal: NDArray[Any]) -> float | None:
    """Variance of a reading, from combinations (D, M) that are noise alone; None if too few.

    By the median, so that a lamp that flickers once is not all there is.
    """
    if combinations.shape[0] < FEWEST:
        return None
    return float(np.median(np.abs(combinations @ signal)) / MEDIAN_OF_NORMAL) ** 2


def levels_by_spectrum(
    measured: NDArray[Any], expected: Floats, contrast: float | None = None
) -> NoiseLevels:
    """Noise of coefficients (K,) that images of contrast 1 vary by ``expected`` (K,) in.

    ``contrast``: its median beforehand, if told.
    """
    power = np.abs(measured) ** 2
    rms = float(np.sqrt(power.mean())) if power.size else 0.0
    if rms == 0:
        return NoiseLevels(np.zeros(1), np.ones(1))
    likelihood = _log_likelihood(power / rms**2, expected / expected.mean())
    if contrast is not None:
        usual = contrast * expected.mean() / rms**2 / (FACTORS @ _weights())
        likelihood -= (np.log(CONTRASTS / usual) / (2 * SPREAD))[:, None] ** 2 / 2
    evidence = np.exp(likelihood - likelihood.max()).sum(axis=0)
    weight = evidence * weigh(LEVELS)
    of_class = np.searchsorted(CLASSES, LEVELS, side="right") - 1
    probability = np.bincount(of_class, weight) / weight.sum()
    sigma = np.bincount(of_class, weight * LEVELS) / np.maximum(
        np.bincount(of_class, weight), 1e-300
    )
    likely = probability > UNLIKELY
    if likely.sum() == 1 and evidence.argmax() == 0:
        return NoiseLevels(np.zeros(1), np.ones(1))
    return NoiseLevels(rms * sigma[likely], probability[likely] / probability[likely].sum())


def weigh(levels: Floats) -> Floats:
    """Prior of each level s, up to a factor: of ln s the density is s^-1/4 from 0.01 on."""
    edges = np.sqrt(levels[1:] * levels[:-1])
    edges = np.concatenate([levels[:1], edges, levels[-1:]])
    return np.diff(np.log(edges)) * np.maximum(levels, 0.01) ** -0.25


def _log_likelihood(power: Floats, expected: Floats) -> Floats:
    """Of each of `CONTRASTS` with each of `LEVELS`."""
    scales = np.unique(np.outer(CONTRASTS, FACTORS).round(12))
    variance = scales[:, None, None] * expected + LEVELS[:, None] ** 2
    density = np.exp(-power / (2 * variance)) / np.sqrt(variance)
    index = np.searchsorted(scales, np.outer(CONTRASTS, FACTORS).round(12))
    mixed = np.einsum("f,cfvk->cvk", _weights(), density[index])
    return np.asarray(np.log(np.maximum(mixed, 1e-300)).sum(axis=-1))


@cache
def _weights() -> Floats:
    """Probability of each of `FACTORS`, of edges between them from 0 to infinity."""
    from scipy.special import gammaincc  # slow to import

    edges = np.concatenate([[1e-300], np.sqrt(FACTORS[1:] * FACTORS[:-1]), [np.inf]])
    return np.asarray(np.diff(gammaincc(FREEDOM / 2, FREEDOM / 2 / edges)))
