"""From the posterior of the ranges to a range and status for each spot."""

from collections.abc import Sequence

import numpy as np

from ...base.arrays import Floats, Mask
from ..ranges import RANGED, Alternative, FogOptics, Ranges, Status
from ..visibility import Visibility
from .modes import LOG_SIGMA
from .numerics import normal_cdf
from .posterior import Posterior, SpotPosterior

MIN_PROBABILITY = 0.98
"""Minimum probability of a known range: any other, or no target, have 2 % together at most."""
MIN_WITHIN = 0.9
"""Minimum probability that it is within"""
TOLERANCE_M = 0.3
"""this tolerance, by its sigma."""
GUESSED_FRACTION = 0.5
"""Backscattering is a guess if its sigma exceeds this fraction of the prior's,"""
MAX_GUESSED_GROWTH = 1.15
"""and ranges whose sigma grows by more than this factor depend on the guess."""
LIKELY_UNEVEN = 0.5
"""Probability of uneven fog above which it is stated as the reason for no range."""

UNKNOWN = Alternative(np.nan, np.nan, np.nan)


def ranges_of(
    spots: Sequence[SpotPosterior],
    statuses: tuple[Status, ...],
    background: Floats,
    fog: FogOptics | None,
    visibility: Visibility | None = None,
    unambiguous_range_m: float = np.inf,
) -> Ranges:
    """The likeliest range of each spot whose status allows one."""
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
        nothing=np.array(
            [
                np.nan if status == "saturated" else max(1 - spot.target, 0.0)
                for spot, status in zip(spots, statuses, strict=True)
            ]
        ),
        unambiguous_range_m=unambiguous_range_m,
        fog=fog,
        visibility=visibility,
    )


def statuses(estimate: Posterior, saturated: Mask, dark: Mask) -> tuple[Status, ...]:
    """Status of each spot; ``dark`` (spots,) marks spots whose readings are just noise."""
    guessed = estimate.fog.log_backscatter_sigma > GUESSED_FRACTION * LOG_SIGMA
    return tuple(
        "saturated" if full else "weak" if noise else unless_uneven(_status(spot, guessed), spot)
        for spot, full, noise in zip(estimate.spots, saturated, dark, strict=True)
    )


def unless_uneven(status: Status, spot: SpotPosterior) -> Status:
    """The status, or that the fog is uneven where this leaves no range."""
    lost = status in ("ambiguous", "fog") and not spot.on_edge
    return "uneven fog" if lost and spot.uneven > LIKELY_UNEVEN else status


def _status(spot: SpotPosterior, guessed: bool) -> Status:
    if spot.on_edge:
        return "ambiguous"
    if not spot.alternatives or spot.target < MIN_PROBABILITY or spot.strength < spot.needed:
        return "fog"
    likeliest = spot.alternatives[0]
    if guessed and likeliest.sigma_m > MAX_GUESSED_GROWTH * spot.noise_m:
        return "fog"
    if spot.echoes == 1 and spot.target * likeliest.weight < MIN_PROBABILITY:
        return "ambiguous"
    within = 2 * normal_cdf(TOLERANCE_M / likeliest.sigma_m) - 1
    return "ok" if within >= MIN_WITHIN else "fog"
