"""What a flight remembers of the third dimension, and the depth map of a frame with it."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats, Mask
from ...capture import Optics
from ...capture.motion import PoseAt, break_between
from ..completion import MapCompletion
from ..method import DepthEstimate
from ..pixels import MIN_DEPTH_M, in_view, pixel_of, seen_before
from .appearance import Appearances
from .clock import ClockOffset
from .maps import MapMemory
from .points import RangeMemory
from .unwrap import LostSpots, Possible, likeliest

MIN_SIGMA = 0.1
"""Sigma of ln depth with which the last map decides on ranges, at least."""
NEARER = 0.8
"""What is nearer by this factor is another thing."""


@dataclass(frozen=True, eq=False)
class FrameRanges:
    """Ranges of a frame: unit vectors (S, 3), metres and standard deviations (S,), nan for none.

    The map of the frame before decides between the ``possible`` ranges, if these are known;
    ``lost`` (S,) are spots that met nothing.
    """

    directions: Floats
    range_m: Floats
    sigma_m: Floats
    possible: Possible | None = None
    lost: Mask | None = None


class Remembered(NamedTuple):
    """A frame's map with the memory, and why that was begun anew, if it was.

    ``points_m`` (N, 3) are its points in the optical frame, in view or not, and
    ``points_log_sigma`` (N,) the standard deviations of their ln depth, infinite of those that are
    not seen. Poses were taken to be late by ``late_s``.
    """

    estimate: DepthEstimate
    points_m: Floats
    points_log_sigma: Floats
    begun_anew: str | None
    late_s: float = 0.0


class FlightMemory:
    """Remembers the ranges and depth maps of frames with poses, in order of time."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._optics, self._shape = optics, shape
        self.complete = MapCompletion(optics, shape)
        self.clock = ClockOffset(optics, shape)
        self._last: PoseAt | None = None
        self._begin()

    def _begin(self) -> None:
        self.ranges = RangeMemory(self._optics, self._shape)
        self._maps = MapMemory(self._optics, self._shape)
        self._lost = LostSpots()
        self._last_map: tuple[PoseAt, Floats, Floats] | None = None
        self._images = Appearances()

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
        appearance = self._images.take(image)
        if log_depth is not None and estimate.sigma is not None:
            ranges = self._decided(pose, ranges, log_depth, estimate.sigma)
        self.ranges.add(pose, ranges.directions, ranges.range_m, ranges.sigma_m, appearance)
        seen = self.ranges.seen(pose, appearance)
        if log_depth is not None and estimate.sigma is not None:
            log_depth = self._maps.take(pose, log_depth, estimate.sigma, appearance)
            averaged = replace(estimate, depth_m=np.exp(log_depth))
            estimate = self.complete(image, averaged, seen)
            assert estimate.sigma is not None
            self._last_map = (
                pose,
                np.log(estimate.depth_m),
                np.maximum(estimate.sigma, MIN_SIGMA),
            )
        points_m = (self.ranges.points.position_m - pose.position_m) @ pose.axes
        log_sigma = np.full(len(points_m), np.inf)
        log_sigma[seen.index] = np.sqrt(seen.log_variance)
        return Remembered(estimate, points_m, log_sigma, why, self.clock.offset_s)

    def _decided(
        self, pose: PoseAt, ranges: FrameRanges, log_depth: Floats, sigma: Floats
    ) -> FrameRanges:
        """Choose each spot's range by the map of the frame before, which does not rest on it.

        The frame's own map chooses where there is no such map. Where it says that something nearer
        is likelier, something may have appeared: there is no range; and if it is sure, the points
        behind are forgotten.
        """
        likelier = 1.0
        if ranges.lost is not None:
            likelier = self._lost.take(ranges.lost, pose.time_s)
        if ranges.possible is None:
            return ranges
        own = self._own_deviation(ranges, log_depth, sigma)
        last = self._last_deviation(pose, ranges)
        last = np.where(np.isnan(last), own, last)
        range_m, sigma_m = likeliest(ranges.possible, last, likelier)
        nearer_m, _ = likeliest(ranges.possible, own, likelier, probability=0.5)
        appeared_m, _ = likeliest(ranges.possible, own, likelier)
        appeared = np.isfinite(appeared_m) & ~(range_m <= appeared_m / NEARER)
        self.ranges.forget_behind(pose, ranges.directions[appeared], appeared_m[appeared])
        doubtful = nearer_m < NEARER * range_m
        range_m, sigma_m = (np.where(doubtful, np.nan, each) for each in (range_m, sigma_m))
        return replace(ranges, range_m=range_m, sigma_m=sigma_m)

    def _own_deviation(self, ranges: FrameRanges, log_depth: Floats, sigma: Floats) -> Floats:
        """Deviation (K, S) of the frame's map from possible ranges, in standard deviations."""
        assert ranges.possible is not None
        pixel = np.round(pixel_of(ranges.directions, self._optics, self._shape))
        row, column = np.clip(pixel, 0, np.array(self._shape) - 1).astype(np.intp).T
        with np.errstate(invalid="ignore", divide="ignore"):  # an echo may lie behind the camera
            possible = np.log(ranges.possible.range_m * ranges.directions[:, 2])
        return np.asarray((possible - log_depth[row, column]) / sigma[row, column])

    def _last_deviation(self, pose: PoseAt, ranges: FrameRanges) -> Floats:
        """That of the last map, where the possible points were then; nan out of its view."""
        possible = ranges.possible
        assert possible is not None
        if self._last_map is None:
            return np.full(possible.range_m.shape, np.nan)
        before, log_depth, sigma = self._last_map
        in_front_m = np.where(possible.range_m > 0, possible.range_m, np.nan)
        points_m = in_front_m[..., None] * ranges.directions
        pixel, local_m = seen_before(before, pose, points_m, self._optics, self._shape)
        depth_m = local_m[..., 2].ravel()
        there = in_view(pixel, self._shape) & (depth_m > MIN_DEPTH_M)
        row, column = np.round(np.where(there[:, None], pixel, 0)).astype(np.intp).T
        off = (np.log(depth_m) - log_depth[row, column]) / sigma[row, column]
        off = np.where(there, off, np.nan).reshape(possible.range_m.shape)
        seen = np.isfinite(off) | ~np.isfinite(possible.range_m)
        return np.where(seen.all(axis=0), off, np.nan)


def _log(estimate: DepthEstimate) -> Floats | None:
    """Logarithm of a map, None unless all its pixels have a depth."""
    if not np.isfinite(estimate.depth_m).all():
        return None
    return np.asarray(np.log(np.maximum(estimate.depth_m, MIN_DEPTH_M)))
