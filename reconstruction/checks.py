"""What methods of others may return: checked before anything is made of it."""

from dataclasses import replace
from typing import Any, get_args

import numpy as np

from .base.arrays import Floats
from .base.errors import InputError
from .depth import DepthEstimate
from .ranging import Ranges, Status


def checked(who: str, values: Any, shape: tuple[int, int]) -> Floats:
    """What another's code returned; InputError unless it is an array of real numbers so shaped."""
    array = np.asarray(values)
    if array.shape != shape or array.dtype.kind not in "iuf":
        raise InputError(
            f"{who} gave {array.dtype} of shape {array.shape}; real numbers of {shape} are needed"
        )
    if np.isinf(array).any():
        raise InputError(f"{who} gave values that are not finite")
    return array.astype(np.float64, copy=False)


def checked_depths(who: str, result: Any, shape: tuple[int, int]) -> DepthEstimate:
    """Depths above 0; with a deviation wherever there is one, and probabilities, if any."""
    if not isinstance(result, DepthEstimate):
        raise InputError(f"{who} gave {type(result).__name__}, not a DepthEstimate")
    depth_m = checked(who, result.depth_m, shape)
    finite = np.isfinite(depth_m)
    if (depth_m[finite] <= 0).any():
        raise InputError(f"{who} gave a depth of {depth_m[finite].min():g} m")
    sigma, no_return = result.sigma, result.no_return
    if sigma is not None:
        sigma = np.where(finite, checked(f"{who}, of the deviation,", sigma, shape), np.nan)
        if not (sigma[finite] >= 0).all():
            raise InputError(f"{who} gave depths with a deviation that is negative or not known")
    if no_return is not None:
        no_return = checked(f"{who}, of nothing within reach,", no_return, shape)
        if not ((no_return >= 0) & (no_return <= 1)).all():
            raise InputError(f"{who} gave probabilities of nothing within reach beyond 0 to 1")
    return replace(result, depth_m=depth_m, sigma=sigma, no_return=no_return)


def checked_ranges(name: str, ranges: Any) -> Ranges:
    """Ranges of four spots with statuses that there are, finite wherever a status has a range."""
    if not (isinstance(ranges, Ranges) and _are_of_four_spots(ranges)):
        raise InputError(f"ranging method {name!r} gave {type(ranges).__name__}, not four ranges")
    unknown = set(ranges.status) - set(get_args(Status))
    if unknown:
        raise InputError(
            f"ranging method {name!r} gave the status {min(unknown)!r}; allowed: "
            f"{', '.join(get_args(Status))}"
        )
    if not np.isfinite(ranges.range_m[ranges.valid]).all():
        raise InputError(f"ranging method {name!r} gave a range that is not finite as 'ok'")
    return ranges


def _are_of_four_spots(ranges: Ranges) -> bool:
    values = dict(vars(ranges))
    values.pop("fog")
    lists = values.pop("status"), values.pop("alternatives")
    return all(np.shape(v) == (4,) for v in values.values()) and all(len(v) == 4 for v in lists)
