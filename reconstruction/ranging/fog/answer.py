"""From what is known of the four ranges to an answer for each spot."""

import numpy as np
from scipy.special import ndtr

from ...arrays import Floats, Mask
from ..ranges import MIN_SIGNAL, Alternative, Ranges, Status
from .modes import LOG_DEVIATION
from .posterior import Posterior

CERTAIN = 0.9
"""Probability from which on a range counts as known,"""
NARROW_M = 0.3
"""give or take so much."""
GUESSED = 0.5
"""Where backscattering is known by more than this share of what is known beforehand, it is a guess,"""
SPOILT = 1.15
"""and ranges that are less certain for it by this factor rest on the guess."""


def ranges_of(
    known: Posterior, saturated: Mask, dark: Mask, signal: Floats, background: Floats
) -> Ranges:
    """Ranges, or the reasons why there are none; ``dark`` (4,) where readings are but noise."""
    status = tuple(
        "saturated" if saturated[spot] else "weak" if dark[spot] else _status(known, spot)
        for spot in range(len(saturated))
    )
    best = [
        found[0] if state == "ok" else Alternative(np.nan, np.nan, np.nan)
        for found, state in zip(known.alternatives, status, strict=True)
    ]
    return Ranges(
        range_m=np.array([each.range_m for each in best]),
        sigma_m=np.array([each.sigma_m for each in best]),
        signal_electrons=signal,
        background_electrons=background,
        status=status,
        alternatives=known.alternatives,
    )


def _status(known: Posterior, spot: int) -> Status:
    alternatives = known.alternatives[spot]
    if not alternatives or known.targets[spot] < CERTAIN or known.strength[spot] < MIN_SIGNAL:
        return "fog"
    likeliest = alternatives[0]
    within = 2 * ndtr(NARROW_M / likeliest.sigma_m) - 1
    guessed = known.log_backscatter[1] > GUESSED * LOG_DEVIATION
    if guessed and likeliest.sigma_m > SPOILT * known.noise_m[spot]:
        return "fog"
    if likeliest.weight * within >= CERTAIN:
        return "ok"
    return "ambiguous" if likeliest.weight < CERTAIN else "fog"
