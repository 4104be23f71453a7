"""What a flight remembers of the third dimension, and the depth map of a frame with it."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats, Mask
from ...capture import Optics
from ...capture.motion import PoseAt, break_between
from ..completion import MapCompletion
from ..method import DepthEstimate
from ..pixels import MIN_DEPTH_M, pixel_of
from .clock import ClockOffset
from .maps import MapMemory
from .points import RangeMemory
from .unwrap import Expected, LostSpots, Possible, likeliest

MIN_SIGMA = 0.1
"""Sigma of ln depth with which the last map decides on ranges, at least."""
NEARER = 0.8
"""What is nearer by this factor is another thing."""


@dataclass(frozen=True, eq=False)
class FrameRanges:
    """Ranges of a frame: unit vectors (S, 3), metres and standard deviations (S,), nan for none.

    The flight's last map decides between the ``possible`` ranges, if these are known; ``lost`` (S,)
    are spots that met nothing.
    """

    directions: Floats
    range_m: Floats
    sigma_m: Floats
    possible: Possible | None = None
    lost: Mask | None = None


class Remembered(NamedTuple):
    """A frame's map with the memory, and why that was begun anew, if it was.

    ``points_m`` (N, 3) are its points in the optical frame, in view or not. Poses were taken to be
    late by ``late_s``.
    """

    estimate: DepthEstimate
    points_m: Floats
    begun_anew: str | None
    late_s: float = 0.0


class FlightMemory:
    """Remembers the ranges and depth maps of frames with poses, in order of time."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._optics, self._shape = optics, shape
        self._complete = MapCompletion(shape)
        self.clock = ClockOffset(optics, shape)
        self._last: PoseAt | None = None
        self._begin()

    def _begin(self) -> None:
        self.ranges = RangeMemory(self._optics, self._shape)
        self._maps = MapMemory(self._optics, self._shape)
        self._lost = LostSpots()
        self._last_map: tuple[Floats, Floats] | None = None

    def take(
        self, stated: PoseAt, image: Floats, estimate: DepthEstimate, ranges: FrameRanges
    ) -> Remembered:
        """Add a frame: its pose, image (H, W), the ``estimate`` of its map alone, and its ranges.

        A map without a standard deviation, or with pixels that have no depth, stays as it is.
        """
        why = None if self._last is None else break_between(self._last, stated)
        self._last = stated
        if why is not None:
            self._begin()
            self.clock.begin()
        log_depth = _log(estimate)
        self.clock.take(stated, image, log_depth)
        pose = self.clock.corrected()
        if log_depth is not None and estimate.sigma is not None:
            ranges = self._decided(pose, ranges, log_depth, estimate.sigma)
        self.ranges.add(pose, ranges.directions, ranges.range_m, ranges.sigma_m)
        if log_depth is not None and estimate.sigma is not None:
            log_depth = self._maps.take(pose, log_depth, estimate.sigma)
            averaged = replace(estimate, depth_m=np.exp(log_depth))
            estimate = self._complete(averaged, self.ranges.seen(pose))
            assert estimate.sigma is not None
            self._last_map = np.log(estimate.depth_m), np.maximum(estimate.sigma, MIN_SIGMA)
        points_m = (self.ranges.points.position_m - pose.position_m) @ pose.axes
        return Remembered(estimate, points_m, why, self.clock.offset_s)

    def _decided(
        self, pose: PoseAt, ranges: FrameRanges, log_depth: Floats, sigma: Floats
    ) -> FrameRanges:
        """Ranges that the last map decides on, in which these have no say yet.

        Where the frame's own map decides for something nearer, something may have appeared: what
        lies behind is forgotten, and a range as far as that is none.
        """
        likelier = 1.0 if ranges.lost is None else self._lost.take(ranges.lost)
        if ranges.possible is None:
            return ranges
        expected = self._expected(ranges.directions, log_depth, sigma)
        range_m, sigma_m = likeliest(ranges.possible, expected, likelier)
        if self._last_map is not None:
            expected, own_m = self._expected(ranges.directions, *self._last_map), range_m
            appeared = own_m < NEARER * np.exp(expected.log_range)
            self.ranges.forget_behind(pose, ranges.directions[appeared], own_m[appeared])
            range_m, sigma_m = likeliest(ranges.possible, expected, likelier)
            range_m = np.where(own_m < NEARER * range_m, np.nan, range_m)
        return replace(ranges, range_m=range_m, sigma_m=sigma_m)

    def _expected(self, directions: Floats, log_depth: Floats, sigma: Floats) -> Expected:
        """What a map of ln depth (H, W) says of ranges along directions (S, 3)."""
        pixel = np.round(pixel_of(directions, self._optics, self._shape))
        row, column = np.clip(pixel, 0, np.array(self._shape) - 1).astype(np.intp).T
        return Expected(log_depth[row, column] - np.log(directions[:, 2]), sigma[row, column])


def _log(estimate: DepthEstimate) -> Floats | None:
    """Logarithm of a map, None unless all its pixels have a depth."""
    if not np.isfinite(estimate.depth_m).all():
        return None
    return np.asarray(np.log(np.maximum(estimate.depth_m, MIN_DEPTH_M)))
