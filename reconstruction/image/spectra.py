"""Fit of coefficients to the power spectrum of images, which identifies the layout of readings.

Coefficients of a natural image have variances v (s_k + r): s_k is the response of row k to a
spectrum that falls with a power of spatial frequency, equally along both axes or not, and r the
white part, noise and all else (D. J. Field, J. Opt. Soc. Am. A 4, 2379 (1987)). Single images are
burstier than this Gaussian model, so the density is Student's t with fitted tails. All parameters
are maximum-likelihood estimates. The alternative is the same density with r alone: coefficients
unrelated to their rows, as of patterns in another order.
"""

from math import lgamma, log, pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .dictionaries.dct import DICTIONARY

EXPONENTS = (1.0, 2.0, 3.0)
"""Powers of spatial frequency by which the spectrum falls."""
ASPECTS = (0.5, 1.0, 2.0)
"""Ratios of the decay along columns to that along rows."""
USUAL_MODEL = ASPECTS.index(1.0) * len(EXPONENTS) + EXPONENTS.index(2.0)
WHITES = np.logspace(-4, 1, 6)
"""White part, relative to the mean of the spectrum."""
FREEDOMS = (1.0, 3.0, 30.0)
"""Degrees of freedom of Student's t: Cauchy, an intermediate density, nearly Gaussian."""
USUAL_FREEDOM = 3.0
MIN_SIGMA = 1e-4
"""Minimum standard deviation, relative to the rms: limits the weight of exact zeros."""
ROUNDS = 6
"""Fixed-point iterations for the scale."""


class Fit(NamedTuple):
    """Log likelihoods of coefficients, with the spectrum of images and with a white one."""

    image: float
    white: float

    @property
    def gain(self) -> float:
        """Log likelihood gained by the spectrum of images."""
        return self.image - self.white


def spectra(operator: MeasurementOperator) -> Floats:
    """Variances (models, K) of the rows other than DC, each up to a common factor."""
    height, width = operator.image_shape
    atoms = operator.in_atoms(DICTIONARY.atoms(height), DICTIONARY.atoms(width))
    return np.array([atoms.by_row(power) for power in powers(operator.image_shape)])


def powers(shape: tuple[int, int]) -> list[Floats]:
    """Variance (H, W) of cosines in images, for each model; 0 for DC."""
    height, width = shape
    vertical, horizontal = np.arange(height)[:, None] / height, np.arange(width) / width
    result = []
    for aspect in ASPECTS:
        square = vertical**2 * aspect + horizontal**2 / aspect
        square[0, 0] = np.inf
        result += [square ** (-exponent / 2) for exponent in EXPONENTS]
    return result


def fit(coefficients: NDArray[Any], models: Floats) -> Fit:
    """Fit of coefficients (K,) of rows with variances ``models`` (models, K)."""
    square = np.abs(coefficients) ** 2
    square = square + MIN_SIGMA**2 * (square.mean() or 1.0)
    shape = models / models.mean(axis=1, keepdims=True)
    mixed = (shape[:, None] + WHITES[:, None]).reshape(-1, square.size)
    best = mixed[[int(np.argmax(_likelihoods(square, mixed, USUAL_FREEDOM)))]]
    flat = np.ones((1, square.size))
    image, white = (
        max(float(_likelihoods(square, variance, freedom)[0]) for freedom in FREEDOMS)
        for variance in (best, flat)
    )
    return Fit(max(image, white), white)


def gaussian(values: Floats) -> float:
    """Maximum log likelihood of values (K,) as Gaussian noise about zero."""
    if not values.size:
        return 0.0
    variance = float(np.mean(values**2)) + np.finfo(float).eps ** 2
    return -values.size / 2 * (log(2 * pi * variance) + 1)


def heavy_tails(values: Floats) -> float:
    """Log likelihood gained by Student's t of the usual freedom over Gaussian noise."""
    square, flat = values[None] ** 2 + np.finfo(float).tiny, np.ones((1, values.size))
    return float(_likelihoods(square[0], flat, USUAL_FREEDOM)[0]) - gaussian(values)


def _likelihoods(square: Floats, variance: Floats, freedom: float) -> Floats:
    """Maximum log likelihood (n,) over the scale of each ``variance`` (n, K), with Student's t."""
    ratio = square / variance
    scale = np.exp(np.log(ratio).mean(axis=1, keepdims=True))
    for _ in range(ROUNDS):  # expectation maximisation, K. L. Lange et al., JASA 84, 881 (1989)
        weighted = (ratio / (freedom * scale + ratio)).sum(axis=1, keepdims=True)
        scale = scale * (freedom + 1) / square.size * weighted
    tails = np.log1p(ratio / (freedom * scale)).sum(axis=1)
    constant = lgamma((freedom + 1) / 2) - lgamma(freedom / 2) - log(freedom * pi) / 2
    spread = (np.log(scale[:, 0]) * square.size + np.log(variance).sum(axis=1)) / 2
    return np.asarray(square.size * constant - spread - (freedom + 1) / 2 * tails)
