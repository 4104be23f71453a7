"""Which of a spot's possible ranges is its range: by the depth map, and the strength of its echo.

Ranging in fog states the possible ranges and their probabilities. With plain ranging, a surface
beyond the unambiguous range R seems to lie at r instead of r + k R, and therefore to be darker than
any: the reflectance that its echo states is too small by (r / (r + k R))², and in fog by exp(-2
alpha k R) more. The motion of the drone does not show it: what is seen at r moves like what is
there. A depth map decides, but no further than `MAX_SIGMAS`.

Surfaces within R seldom are too dark to be met. Where many spots meet nothing, part of the scene is
out of reach, and an echo may be of that rather than of something dark and near.
"""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from ...base.arrays import Floats, Mask
from ...ranging import Alternative

LOG_REFLECTANCE, SPREAD = -1.2, 0.9
"""Mean and standard deviation of the logarithm of reflectance times the cosine of incidence."""
MULTIPLES = np.arange(3)[:, None]
LOG_PRIOR = np.log(0.1)
"""Of each multiple relative to the one before: most of what is met is near."""
MAX_SIGMAS = 2.0
"""Deviation from a map beyond which it speaks no louder."""
MIN_PROBABILITY = 0.8
"""Of the range that is taken; with less, there is none."""
MEMORY_S = 0.25
"""Time over which lost spots are forgotten."""
PER_LOST, MAX_LIKELIER = 10.0, 5.0
"""What is beyond R is likelier by 1 + 2 × (frames lost / other frames), at most 3."""


class Possible(NamedTuple):
    """Possible ranges (K, S) of spots, their sigmas and log probabilities; nan for none.

    ``beyond`` (K, S) marks those beyond the unambiguous range.
    """

    range_m: Floats
    sigma_m: Floats
    log_weight: Floats
    beyond: Mask

    @classmethod
    def of(cls, alternatives: Sequence[Sequence[Alternative]], max_range_m: float = np.inf) -> Self:
        """Those that a ranging method states of each spot."""
        most = max((len(each) for each in alternatives), default=0)
        result = np.full((3, max(most, 1), len(alternatives)), np.nan)
        for spot, each in enumerate(alternatives):
            if each:
                result[:, : len(each), spot] = np.transpose(each)
        return cls(result[0], result[1], np.log(result[2]), result[0] > max_range_m)

    @classmethod
    def wrapped(
        cls,
        range_m: Floats,
        sigma_m: Floats,
        log_reflectance: Floats,
        max_range_m: float,
        extinction_per_m: float = 0.0,
    ) -> Self:
        """Ranges (S,) and what they are beyond ``max_range_m``, from where these repeat.

        ``log_reflectance`` (S,) is that of a facing surface at ``range_m``, nan if unknown: then
        the range stays as it is.
        """
        farther_m = MULTIPLES * max_range_m
        possible_m = range_m + farther_m
        log = log_reflectance + 2 * np.log(possible_m / range_m) + 2 * extinction_per_m * farther_m
        weight = MULTIPLES * LOG_PRIOR - 0.5 * ((log - LOG_REFLECTANCE) / SPREAD) ** 2
        alone = np.where(MULTIPLES == 0, 0.0, -np.inf)
        weight = np.where(np.isfinite(log_reflectance), weight, alone)
        sigma_m, beyond = np.broadcast_arrays(sigma_m, MULTIPLES > 0, possible_m)[:2]
        return cls(possible_m, sigma_m, weight, beyond)


class LostSpots:
    """Numbers of spots, in frames, that met nothing and something lately."""

    def __init__(self) -> None:
        self._lost = self._met = 0.0
        self._time_s = -np.inf

    def take(self, lost: Mask, time_s: float) -> float:
        """Add the spots (S,) of a frame; how much likelier than usual what is beyond R is."""
        kept = np.exp((self._time_s - time_s) / MEMORY_S)
        fraction, self._time_s = float(np.mean(lost)), time_s
        self._lost = kept * self._lost + fraction
        self._met = kept * self._met + 1 - fraction
        return float(min(1 + PER_LOST * self._lost / (self._met + 1), MAX_LIKELIER))


def likeliest(
    possible: Possible,
    deviation: Floats,
    likelier: float = 1.0,
    probability: float = MIN_PROBABILITY,
) -> tuple[Floats, Floats]:
    """Likeliest range of each spot (S,) and its sigma, nan where it has less than a probability.

    ``deviation`` (K, S) is that of a map from the possible ranges, in its standard deviations. What
    is beyond the unambiguous range is so much ``likelier`` than usual.
    """
    log = possible.log_weight + np.log(likelier) * possible.beyond
    log = log - 0.5 * np.minimum(np.abs(deviation), MAX_SIGMAS) ** 2
    log = np.where(np.isfinite(log), log, -np.inf)
    best, spot = log.argmax(axis=0), np.arange(log.shape[1])
    with np.errstate(invalid="ignore"):
        share = 1 / np.exp(log - log[best, spot]).sum(axis=0)
    sure = share >= probability  # not where nothing is possible: nan
    range_m, sigma_m = (np.where(sure, each[best, spot], np.nan) for each in possible[:2])
    return range_m, sigma_m
