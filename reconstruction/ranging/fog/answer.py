"""From what is known of the four ranges to an answer for each spot."""

from collections.abc import Sequence

import numpy as np

from ...base.arrays import Floats, Mask
from ..ranges import RANGED, Alternative, FogOptics, Ranges, Status
from .modes import LOG_SIGMA
from .numerics import normal_cdf
from .posterior import Posterior, SpotPosterior

MIN_PROBABILITY = 0.9
"""Probability from which on a range counts as known,"""
TOLERANCE_M = 0.3
"""give or take so much."""
GUESSED_FRACTION = 0.5
"""Where backscattering is as uncertain as this share of what is known before, it is a guess,"""
MAX_GUESSED_GROWTH = 1.15
"""and ranges that are less certain for it by this factor rest on the guess."""

UNKNOWN = Alternative(np.nan, np.nan, np.nan)


def ranges_of(
    spots: Sequence[SpotPosterior],
    statuses: tuple[Status, ...],
    background: Floats,
    fog: FogOptics | None,
) -> Ranges:
    """The likeliest range of each spot whose status has one."""
    best = [
        spot.alternatives[0] if status in RANGED else UNKNOWN
        for spot, status in zip(spots, statuses, strict=True)
    ]
    return Ranges(
        range_m=np.array([each.range_m for each in best]),
        sigma_m=np.array([each.sigma_m for each in best]),
        signal_electrons=np.array([spot.signal for spot in spots]),
        background_electrons=background,
        status=statuses,
        alternatives=tuple(spot.alternatives for spot in spots),
        fog=fog,
    )


def statuses(estimate: Posterior, saturated: Mask, dark: Mask) -> tuple[Status, ...]:
    """Of each spot; ``dark`` (4,) where readings are but noise."""
    guessed = estimate.fog.log_backscatter_sigma > GUESSED_FRACTION * LOG_SIGMA
    return tuple(
        "saturated" if full else "weak" if noise else _status(spot, guessed)
        for spot, full, noise in zip(estimate.spots, saturated, dark, strict=True)
    )


def _status(spot: SpotPosterior, guessed: bool) -> Status:
    if spot.on_edge:
        return "ambiguous"
    if not spot.alternatives or spot.target < MIN_PROBABILITY or spot.strength < spot.needed:
        return "fog"
    likeliest = spot.alternatives[0]
    if guessed and likeliest.sigma_m > MAX_GUESSED_GROWTH * spot.noise_m:
        return "fog"
    within = 2 * normal_cdf(TOLERANCE_M / likeliest.sigma_m) - 1
    probability = 1.0 if spot.echoes > 1 else likeliest.weight
    if probability * within >= MIN_PROBABILITY:
        return "ok"
    return "ambiguous" if probability < MIN_PROBABILITY else "fog"
