"""Noise that a recording does not tell, from its readings.

What is shown twice tells it by itself (`redundant_combinations`). Otherwise it is the white part of
the coefficients' power, as far as it cannot be the image: coefficients of images vary as the prior
expects, times factors of their own with an inverse gamma distribution, so that they are of
Student's t distribution, with many small values among few large ones; noise is Gaussian. The
standard deviation is the mean over all variances and contrasts, each as probable as the
coefficients make it, less a share for texture (`TEXTURE`), and 0 where none is the likeliest. A
white texture cannot be told from noise.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..operators import SparseRows

FEWEST = 8
"""Combinations that tell the noise by themselves."""
MEDIAN_OF_NORMAL = 0.6745
"""Median of the magnitude of a normal variable of variance 1."""
FREEDOM = 3.0
"""Degrees of freedom of the t distribution."""
FACTORS = 4.0 ** np.arange(-2, 3)
"""Factors of the variance."""
TEXTURE = 0.2
"""How much of the white part is texture, edges above all: of a variance that is the share s of
the power, s^0.2 is noise."""
CONTRASTS = 4.0 ** np.arange(-7, 1.5, 0.5)
VARIANCES = np.append(0.0, np.logspace(-5, 0.3, 36))
"""Of signal and noise, over the power of the coefficients."""


def variance_by_repetition(combinations: SparseRows, signal: NDArray[Any]) -> float | None:
    """Variance of a reading, from combinations (D, M) that are noise alone; None if too few.

    By the median, so that a lamp that flickers once is not all there is.
    """
    if combinations.shape[0] < FEWEST:
        return None
    return float(np.median(np.abs(combinations @ signal)) / MEDIAN_OF_NORMAL) ** 2


def variance_by_spectrum(measured: NDArray[Any], expected: Floats) -> float:
    """Variance of the noise of coefficients (K,) that images vary by ``expected`` (K,) in."""
    power = np.abs(measured) ** 2
    mean = float(power.mean()) if power.size else 0.0
    if mean == 0:
        return 0.0
    likelihood = _log_likelihood(power / mean, expected / expected.mean())
    weight = np.exp(likelihood - likelihood.max()).sum(axis=0)
    if weight.argmax() == 0:
        return 0.0
    share = float(np.sqrt(VARIANCES) @ weight / weight.sum()) ** 2
    return mean * share * min(share, 1.0) ** TEXTURE


def _log_likelihood(power: Floats, expected: Floats) -> Floats:
    """Of each of `CONTRASTS` with each of `VARIANCES`."""
    from scipy.special import gammaincc  # slow to import

    weights = np.diff(gammaincc(FREEDOM / 2, FREEDOM / 2 / _edges()))
    scales = np.unique(np.outer(CONTRASTS, FACTORS).round(12))
    variance = scales[:, None, None] * expected + np.maximum(VARIANCES, 1e-9)[:, None]
    density = np.exp(-power / (2 * variance)) / np.sqrt(variance)
    places = np.searchsorted(scales, np.outer(CONTRASTS, FACTORS).round(12))
    mixed = np.einsum("f,cfvk->cvk", weights, density[places])
    return np.asarray(np.log(np.maximum(mixed, 1e-300)).sum(axis=-1))


def _edges() -> Floats:
    """Between the factors, from 0 to infinity."""
    between = np.sqrt(FACTORS[1:] * FACTORS[:-1])
    return np.concatenate([[1e-300], between, [np.inf]])
