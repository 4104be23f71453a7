"""Noise that a recording does not tell, from its readings.

What is shown twice tells it by itself (`redundant_combinations`). Otherwise it is the white part of
the coefficients' power: coefficients of images vary as the prior expects, by an exponent of the
spectrum that is one of several and a contrast of any size, and those of noise all alike. The
variance is the mean over all exponents and white parts, each as probable as the coefficients make
it (the contrast by its maximum). A white texture cannot be told from noise.
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
POWERS = (1.0, 1.5, 2.0)
"""Of the prior's variance: exponents of 2 to 4 of spatial frequency. A spectrum that falls with the
first power is nearly white where patterns are few."""
WHITE = np.logspace(-6, 3, 91)
"""White parts that are tried, relative to the mean variance."""


def variance_by_repetition(combinations: SparseRows, signal: NDArray[Any]) -> float | None:
    """Variance of a reading, from combinations (D, M) that are noise alone; None if too few.

    By the median, so that a lamp that flickers once is not all there is.
    """
    if combinations.shape[0] < FEWEST:
        return None
    return float(np.median(np.abs(combinations @ signal)) / MEDIAN_OF_NORMAL) ** 2


def variance_by_spectrum(measured: NDArray[Any], expected: Floats) -> float:
    """Variance of the noise of coefficients (K,) that images vary by ``expected`` (E, K) in.

    Each of the E spectra is known up to a factor. Complex coefficients have noise in both parts.
    """
    power = np.abs(measured) ** 2
    mean = float(power.mean()) if power.size else 0.0
    if mean == 0:
        return 0.0
    half = 1.0 if np.iscomplexobj(measured) else 0.5  # the densities of two numbers, or of one
    shape = (expected / expected.mean(axis=1, keepdims=True))[:, None] + WHITE[:, None]
    scale = (power / mean / shape).mean(axis=-1)
    density = -half * (power.size * np.log(scale) + np.log(shape).sum(axis=-1))
    weight = np.exp(density - density.max())
    return mean * float((weight * scale * WHITE).sum() / weight.sum())
