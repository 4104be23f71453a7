"""Which of a spot's possible ranges is its range: by the depth map, and the strength of its echo.

Ranging in fog states the possible ranges and their probabilities. With plain ranging, a surface
beyond the unambiguous range R seems to lie at r instead of r + k R, and therefore to be darker than
any: the reflectance that its echo states is too small by (r / (r + k R))², and in fog by exp(-2
alpha k R) more. The motion of the drone does not show it: what is seen at r moves like what is
there. The depth map of the frame has its say, but not the last word: it rests on the same ranges.

Surfaces within R seldom are too dark to be met. Where most spots meet nothing, most of the scene is
out of reach, and the few echoes that come back are rather of that than of something dark and near.
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
"""Deviation from the map beyond which it speaks no louder."""
MIN_PROBABILITY = 0.8
"""Of the range that is taken; with less, there is none."""
FORGETTING = 1 - 1 / 30
"""Weight of the spots of a frame relative to those of the next."""
PER_LOST, MAX_LIKELIER = 10.0, 10.0
"""How much likelier each lost spot of one that is not makes what is beyond R, and the maximum."""


class Expected(NamedTuple):
    """What is expected of ranges (S,): their logarithm by the depth map, and its sigma."""

    log_range: Floats
    sigma: Floats


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
    """Fraction of a flight's spots that met nothing lately."""

    def __init__(self) -> None:
        self._lost = self._met = 0.0

    def take(self, lost: Mask) -> float:
        """Add the spots (S,) of a frame; how much likelier than usual what is beyond R is."""
        fraction = float(np.mean(lost))
        self._lost = FORGETTING * self._lost + fraction
        self._met = FORGETTING * self._met + 1 - fraction
        return min(1 + PER_LOST * self._lost / (self._met + 1), MAX_LIKELIER)


def likeliest(
    possible: Possible, expected: Expected, likelier: float = 1.0
) -> tuple[Floats, Floats]:
    """Likeliest range of each spot (S,) and its sigma, nan where none is likely enough.

    What is beyond the unambiguous range is so much ``likelier`` than usual.
    """
    with np.errstate(invalid="ignore", divide="ignore"):  # an echo may lie behind the instrument
        off = np.abs(np.log(possible.range_m) - expected.log_range) / expected.sigma
    log = possible.log_weight + np.log(likelier) * possible.beyond
    log -= 0.5 * np.minimum(off, MAX_SIGMAS) ** 2
    log = np.where(np.isfinite(log), log, -np.inf)
    best, spot = log.argmax(axis=0), np.arange(log.shape[1])
    with np.errstate(invalid="ignore"):
        share = 1 / np.exp(log - log[best, spot]).sum(axis=0)
    sure = share >= MIN_PROBABILITY  # not where nothing is possible: nan
    range_m, sigma_m = (np.where(sure, each[best, spot], np.nan) for each in possible[:2])
    return range_m, sigma_m
