"""Visibility, as estimated with the ranges."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

BACKSCATTER_PER_SR = 0.044
"""Median of albedo times phase function within 20 mrad of 180 degrees, at 1550 nm,"""
BACKSCATTER_LOG_SIGMA = 0.18
"""and sigma of its logarithm, of fogs of droplets with modes of 2 to 10 µm (Mie),"""
EXTINCTION_RATIO = 1.07
"""median of their extinction at 1550 nm over that at 550 nm,"""
RATIO_LOG_SIGMA = 0.03
"""and sigma of its logarithm."""
MODEL_LOG_SIGMA = 0.05
"""What all frames are wrong by: light that fog scatters more than once, about 3 % of its echo, and
patches that stand still."""
ONE_SIDED = 1.645
"""Standard deviations above which 5 % of a normal distribution lie."""
MAX_CLEAR = 0.05
"""Maximum probability of clear air at which a visibility is stated."""


class Visibility(NamedTuple):
    """Visibility in fog of water droplets: where 2 % of contrast are left, as scenes state it.

    The meteorological optical range of the WMO, where 5 % are left (Guide to Instruments and
    Methods of Observation, WMO-No. 8, 2018, volume I, chapter 9), is 0.766 of it.

    ``visibility_m`` is the median, ``log_sigma`` the standard deviation of its logarithm; both are
    nan in air so clear that only the lower bound ``at_least_m`` (95 %) is known.
    """

    visibility_m: float
    log_sigma: float
    at_least_m: float

    @property
    def numbers(self) -> dict[str, float | None]:
        """All values by name, None for nan."""
        return {name: None if math.isnan(each) else each for name, each in self._asdict().items()}

    def __str__(self) -> str:
        if math.isnan(self.visibility_m):
            return f"at least {self.at_least_m:.3g} m"
        return f"{self.visibility_m:.3g} m ± {100 * self.log_sigma:.0f} %"


def pooled(visibilities: Iterable[Visibility | None]) -> Visibility | None:
    """Visibility of frames in the same air; None if no frame has any.

    Frames count by their inverse variance. What they share does not average out: the prior of the
    droplets, as far as the readings left it to the prior, and the error of the model.
    """
    given = np.array([each for each in visibilities if each is not None])
    if not given.size:
        return None
    known = given[~np.isnan(given[:, 0])]
    if 2 * len(known) < len(given):
        return Visibility(math.nan, math.nan, float(np.median(given[:, 2])))
    log_m, variance = np.log(known[:, 0]), known[:, 1] ** 2
    weight = 1 / variance / (1 / variance).sum()
    prior, shared = BACKSCATTER_LOG_SIGMA**2, RATIO_LOG_SIGMA**2 + MODEL_LOG_SIGMA**2
    of_prior = np.minimum(variance - RATIO_LOG_SIGMA**2, prior) / math.sqrt(prior)
    own = np.maximum(variance - shared - of_prior**2, 0.0)
    sigma = math.sqrt(shared + (weight @ of_prior) ** 2 + weight**2 @ own)
    median_m = math.exp(weight @ log_m)
    return Visibility(median_m, sigma, median_m * math.exp(-ONE_SIDED * sigma))
