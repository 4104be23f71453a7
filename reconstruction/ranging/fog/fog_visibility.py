"""Visibility from the posterior of the fog.

Backscattering is measured well, extinction by the echo's shape alone. Of fog of water droplets,
which a visibility presumes, the ratio of the two is known better than the prior of ranging has it,
which is for haze and smoke, too.
"""

import numpy as np

from ...base.arrays import Floats
from ..visibility import (
    BACKSCATTER_LOG_SIGMA,
    BACKSCATTER_PER_SR,
    EXTINCTION_RATIO,
    MAX_CLEAR,
    ONE_SIDED,
    RATIO_LOG_SIGMA,
    Visibility,
)
from ..weather import KOSCHMIEDER
from .fog_state import FogState
from .modes import LOG_SIGMA, expected_backscatter

FINE = 256
"""Extinctions at which the posterior is interpolated."""
NEGLIGIBLE = 1e-12
"""Probability of an extinction below which its backscattering is not fitted."""


def visibility_of(fog: FogState, extinctions_per_m: Floats) -> Visibility:
    """Visibility, for the extinctions (K,) of the posterior, the first that of clear air.

    In clear air the extinction may be anything up to the second.
    """
    log = np.log(extinctions_per_m)
    clear = float(fog.probability[0])
    fine = np.linspace((log[0] + log[1]) / 2, log[-1], FINE)
    density = _interpolated(fine, log[1:], _log_density(fog, log)[1:])
    weight = np.exp(density - density.max())
    weight /= weight.sum()
    bound = fine[np.searchsorted(clear + (1 - clear) * np.cumsum(weight), 0.95)]
    of_unit = KOSCHMIEDER * EXTINCTION_RATIO
    farthest_m = of_unit * np.exp(-ONE_SIDED * RATIO_LOG_SIGMA)
    if clear > MAX_CLEAR:
        return Visibility(np.nan, np.nan, float(farthest_m / np.exp(max(bound, log[1]))))
    mean = weight @ fine
    sigma = np.hypot(np.sqrt(weight @ (fine - mean) ** 2), RATIO_LOG_SIGMA)
    return Visibility(
        float(of_unit / np.exp(mean)), float(sigma), float(farthest_m / np.exp(bound))
    )


def _log_density(fog: FogState, log: Floats) -> Floats:
    """Log density (K,) of the logarithms of extinctions, with the prior of droplets."""
    fitted = fog.probability > NEGLIGIBLE
    median = np.interp(log, log[fitted], fog.log_median[fitted])
    precision = np.interp(log, log[fitted], fog.log_sigma[fitted]) ** -2.0
    wide = np.log(expected_backscatter(np.exp(log))) - median
    narrow = np.log(BACKSCATTER_PER_SR) + log - median
    more, less = BACKSCATTER_LOG_SIGMA**-2, LOG_SIGMA**-2
    total = precision + more - less
    squares = (more * narrow - less * wide) ** 2 / total - more * narrow**2 + less * wide**2
    return np.asarray(
        np.log(np.maximum(fog.probability, 1e-300)) + (squares + np.log(precision / total)) / 2
    )


def _interpolated(at: Floats, x: Floats, y: Floats) -> Floats:
    """Cubic interpolation that is exact for parabolas; linear beyond the ends."""
    slope = np.gradient(y, x, edge_order=2)
    below = np.clip(np.searchsorted(x, at) - 1, 0, x.size - 2)
    step = x[below + 1] - x[below]
    u = np.clip((at - x[below]) / step, 0, 1)
    v = 1 - u
    inner = v**2 * ((1 + 2 * u) * y[below] + u * step * slope[below]) + u**2 * (
        (1 + 2 * v) * y[below + 1] - v * step * slope[below + 1]
    )
    return np.asarray(inner + slope[0] * np.minimum(at - x[0], 0))
