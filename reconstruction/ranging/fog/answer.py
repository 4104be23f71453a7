"""From what is known of the four ranges to an answer for each spot."""

import numpy as np

from ...arrays import Floats, Mask
from ..ranges import Alternative, Ranges, Status
from .chances import normal_share
from .modes import LOG_DEVIATION
from .posterior import Posterior, SpotPosterior
from .templates import EXTINCTIONS_PER_M

CERTAIN = 0.9
"""Probability from which on a range counts as known,"""
NARROW_M = 0.3
"""give or take so much."""
GUESSED = 0.5
"""Where backscattering is as uncertain as this share of what is known before, it is a guess,"""
SPOILT = 1.15
"""and ranges that are less certain for it by this factor rest on the guess."""

UNKNOWN = Alternative(np.nan, np.nan, np.nan)


def ranges_of(
    known: Posterior, saturated: Mask, dark: Mask, background: Floats, numbers: int
) -> Ranges:
    """Ranges, or the reasons why there are none; ``dark`` (4,) where readings are but noise.

    ``numbers`` are told by each spot's readings. Range and reflectance take two of them, and where
    there are no more, nothing is left that tells the fog.
    """
    guessed = known.fog.log_backscatter_sigma > GUESSED * LOG_DEVIATION
    blind = guessed and numbers <= 2

    def status(spot: int) -> Status:
        if saturated[spot]:
            return "saturated"
        if dark[spot]:
            return "weak"
        return "fog" if blind else _status(known.spots[spot], guessed)

    statuses = tuple(map(status, range(4)))
    best = [
        spot.alternatives[0] if each == "ok" else UNKNOWN
        for spot, each in zip(known.spots, statuses, strict=True)
    ]
    return Ranges(
        range_m=np.array([each.range_m for each in best]),
        sigma_m=np.array([each.sigma_m for each in best]),
        signal_electrons=np.array([spot.signal for spot in known.spots]),
        background_electrons=background,
        status=statuses,
        alternatives=tuple(spot.alternatives for spot in known.spots),
        fog=known.fog.optics(EXTINCTIONS_PER_M),
    )


def _status(spot: SpotPosterior, guessed: bool) -> Status:
    if spot.on_edge:
        return "ambiguous"
    if not spot.alternatives or spot.target < CERTAIN or spot.strength < spot.needed:
        return "fog"
    likeliest = spot.alternatives[0]
    if guessed and likeliest.sigma_m > SPOILT * spot.noise_m:
        return "fog"
    within = 2 * normal_share(NARROW_M / likeliest.sigma_m) - 1
    probability = 1.0 if spot.echoes > 1 else likeliest.weight
    if probability * within >= CERTAIN:
        return "ok"
    return "ambiguous" if probability < CERTAIN else "fog"
