"""Visibility, a property at visible wavelengths, and the extinction at 550 nm that it fixes."""

import math
from collections.abc import Mapping
from types import MappingProxyType

from reconstruction.base.errors import InputError, nearest

VISUAL_NM = 550.0
#: Minimum visibility, even of dense smoke.
MIN_VISIBILITY_M = 0.01
# Contrast at which a black object against the horizon is just visible.
CONTRAST_THRESHOLDS: Mapping[str, float] = MappingProxyType({"koschmieder": 0.02, "mor": 0.05})


def extinction_at_550nm(visibility_m: float, definition: str = "koschmieder") -> float:
    """Extinction coefficient at 550 nm, 1/m, of air with a visibility.

    Parameters
    ----------
    visibility_m : float
        Finite, at least `MIN_VISIBILITY_M`.
    definition : str
        "koschmieder" (2 % contrast, 3.912/V) or "mor" (the meteorological optical range of the WMO,
        5 % contrast, 2.996/V); confusing them is an error of 31 %.

    Raises
    ------
    InputError
        For other values.
    """
    if not (math.isfinite(visibility_m) and visibility_m > 0):
        raise InputError(f"visibility_m should be greater than 0 and finite; found {visibility_m}")
    if visibility_m < MIN_VISIBILITY_M:
        raise InputError(
            f"visibility_m should be at least {MIN_VISIBILITY_M:g}; found {visibility_m:g}"
        )
    return _optical_depth(definition) / visibility_m


def visibility(extinction_550_per_m: float, definition: str = "koschmieder") -> float:
    """Visibility in metres of air with this extinction at 550 nm; see `extinction_at_550nm`."""
    return _optical_depth(definition) / extinction_550_per_m


def _optical_depth(definition: str) -> float:
    if definition not in CONTRAST_THRESHOLDS:
        raise InputError(
            f"definition {definition!r} of visibility: {nearest(definition, CONTRAST_THRESHOLDS)}"
        )
    return -math.log(CONTRAST_THRESHOLDS[definition])
