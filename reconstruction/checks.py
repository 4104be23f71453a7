"""Checks of frames to reconstruct, and of what solvers of methods return, before their use."""

from dataclasses import replace
from typing import Any, get_args

import numpy as np

from .base.arrays import Floats
from .base.errors import InputError
from .capture import Frames, Setup
from .depth import DepthEstimate
from .image import Estimate
from .ranging import Ranges, Status


def check_frames(frames: Any, setup: Setup) -> None:
    """Raise InputError unless frames are of a recording that has the setup."""
    if not isinstance(frames, Frames) or not len(frames):
        raise InputError(f"got {type(frames).__name__}, expected `Frames`, as of Capture.batch")
    expected, given = (
        (
            f"{exposures} exposures, {type(part.spots).__name__} "
            f"of {0 if part.spots is None else len(part.spots.directions)} "
            f"{'' if part.spots is None or part.spots.pointing is None else 'steered '}spots, "
            f"{'no ' if part.pattern_taps is None else ''}taps of patterns"
        )
        for part, exposures in (
            (setup, setup.plan.exposures),
            (frames, frames.buckets.counts.shape[1]),
        )
    )
    if given != expected:
        raise InputError(f"frames of another recording: they have {given}; compiled for {expected}")


def checked(who: str, values: Any, shape: tuple[int, ...]) -> Floats:
    """Values as float64; InputError unless they are an array of real numbers of this shape."""
    array = np.asarray(values)
    if array.shape != shape or array.dtype.kind not in "iuf":
        raise InputError(
            f"{who} returned {array.dtype} of shape {array.shape}; expected real numbers of shape "
            f"{shape}"
        )
    if np.isinf(array).any():
        raise InputError(f"{who} returned values that are not finite")
    return array.astype(np.float64, copy=False)


def checked_image(who: str, estimate: Any, shape: tuple[int, int]) -> Estimate:
    """Finite values (H, W), and standard deviations if there are any; InputError for others."""
    if not isinstance(estimate, Estimate):
        raise InputError(f"{who} returned {type(estimate).__name__}, not an Estimate")
    image, sigma = checked(who, estimate.image, shape), estimate.sigma
    if sigma is not None:
        sigma = checked(f"{who}, as sigma,", sigma, shape)
    for values in (image, *([] if sigma is None else [sigma])):
        if not np.isfinite(values).all():
            raise InputError(f"{who} returned values that are not finite")
    return Estimate(image, sigma, estimate.note)


def checked_depths(who: str, estimate: Any, shape: tuple[int, int]) -> DepthEstimate:
    """Depths above 0 with valid standard deviations and probabilities; InputError for others."""
    if not isinstance(estimate, DepthEstimate):
        raise InputError(f"{who} returned {type(estimate).__name__}, not a DepthEstimate")
    depth_m = checked(who, estimate.depth_m, shape)
    finite = np.isfinite(depth_m)
    if (depth_m[finite] <= 0).any():
        raise InputError(f"{who} returned a depth of {depth_m[finite].min():g} m")
    sigma, no_return = estimate.sigma, estimate.no_return
    if sigma is not None:
        sigma = np.where(finite, checked(f"{who}, as sigma,", sigma, shape), np.nan)
        if not (sigma[finite] >= 0).all():
            raise InputError(f"{who} returned depths with a sigma that is negative or nan")
    if no_return is not None:
        no_return = checked(f"{who}, as no_return,", no_return, shape)
        if not ((no_return >= 0) & (no_return <= 1)).all():
            raise InputError(f"{who} returned probabilities of no return outside 0..1")
    points_m = estimate.points_m
    if points_m is not None:
        points_m = checked(f"{who}, as points_m,", points_m, (*np.shape(points_m)[:1], 3))
        if np.isnan(points_m).any():
            raise InputError(f"{who}, as points_m, returned values that are not finite")
    log_sigma = estimate.points_log_sigma
    if log_sigma is not None and not (
        points_m is not None
        and np.shape(log_sigma) == points_m.shape[:1]
        and (np.asarray(log_sigma) >= 0).all()
    ):
        raise InputError(f"{who}: points_log_sigma needs a number of at least 0 for each point")
    return replace(estimate, depth_m=depth_m, sigma=sigma, no_return=no_return, points_m=points_m)


def checked_ranges(name: str, ranges: Any, spots: int) -> Ranges:
    """Ranges of so many spots, finite wherever the status says so; InputError for others."""
    who = f"ranging method {name!r}"
    if not (isinstance(ranges, Ranges) and _are_of(ranges, spots)):
        raise InputError(f"{who} returned {type(ranges).__name__}, not ranges of {spots} spot(s)")
    unknown = set(ranges.status) - set(get_args(Status))
    if unknown:
        raise InputError(
            f"{who} returned the status {min(unknown)!r}; allowed: {', '.join(get_args(Status))}"
        )
    if not np.isfinite(ranges.range_m[ranges.valid]).all():
        raise InputError(f"{who} returned a range that is not finite as 'ok'")
    if not (ranges.range_m[ranges.valid] > 0).all():
        raise InputError(f"{who} returned a range of {ranges.range_m.min():g} m as 'ok'")
    if not (np.isnan(ranges.nothing) | ((ranges.nothing >= 0) & (ranges.nothing <= 1))).all():
        raise InputError(f"{who} returned nothing = {ranges.nothing.tolist()}, not probabilities")
    return ranges


def _are_of(ranges: Ranges, spots: int) -> bool:
    of_all = ("unambiguous_range_m", "fog", "visibility")
    values = {name: v for name, v in vars(ranges).items() if name not in of_all}
    lists = values.pop("status"), values.pop("alternatives")
    shapes = {np.shape(v) for v in values.values()} | {(len(v),) for v in lists}
    return shapes == {(spots,)}
