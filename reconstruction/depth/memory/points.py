"""World points that a flight's ranges have met: kept, carried into a view, and forgotten.

A range is a point of the world, as its frame's pose says. In a later view it has a pixel and a
depth, whose errors are those of range and poses. Points of one place are fused, so that some
hundreds of them hold what seconds of ranges say. What the spots show to be gone, and what was next
to it, is dropped: a thing that moves leaves no points behind. Points of places that no longer look
as they did are not seen until they do.
"""

from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask
from ...capture import Optics
from ...capture.motion import PoseAt
from ..completion import MAX_LOG_SIGMA, Rows, Seen
from ..pixels import distances, in_view, pixel_of
from .appearance import Appearance

MAX_POINTS = 600
NEAREST_M = 0.1
"""Depth below which a point is not in view."""
SAME_PIXELS, SAME_SIGMAS = 0.7, 2.0
"""Maximum distance of points that are fused, in pixels and in standard deviations of ln depth."""
HIDDEN_PIXELS, HIDDEN_LOG = 2.0, 0.1
"""A point is hidden by one this close in the image and nearer by this much in ln depth."""
CARVED_PIXELS, CARVED_SIGMAS, CARVED_LOG = 1.5, 4.0, 0.05
"""A spot within so many pixels that meets something farther shows that a point is gone."""
NEIGHBOUR_PIXELS, NEIGHBOUR_LOG = 8.0, 0.1
"""Points next to one that is gone are of the same thing, and gone too."""

BEHIND_PIXELS, BEHIND_LOG = 4.0, 0.2
"""What a frame's own ranges meet, and what may have appeared, hides points this close in the image
and farther by this much."""


@dataclass(frozen=True, eq=False)
class Points(Rows):
    """Points (N,) of the world.

    ``position_m`` (N, 3), ``log_variance`` of their range, ``time_s`` at which they were last met,
    the variances of position, m², and rotation, rad², of the pose that they rest on, their depth
    then and the image's ``brightness`` there, nan if unknown.
    """

    position_m: Floats
    log_variance: Floats
    time_s: Floats
    pose_variance_m2: Floats
    pose_variance_rad2: Floats
    depth_m: Floats
    brightness: Floats

    @classmethod
    def none(cls) -> Self:
        """No points."""
        return cls(np.zeros((0, 3)), *(np.zeros(0) for _ in range(6)))

    def __len__(self) -> int:
        return len(self.time_s)

    def __add__(self, other: "Points") -> "Points":
        """These and others."""
        pairs = ((getattr(self, each.name), getattr(other, each.name)) for each in fields(self))
        return Points(*(np.concatenate(pair) for pair in pairs))


class RangeMemory:
    """Points met by the spots so far, at most `MAX_POINTS`, the oldest are forgotten first."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._optics, self._shape = optics, shape
        self._pixels_per_rad = shape[0] / 2 / optics.tan_half_height
        self.points = Points.none()

    def add(
        self,
        pose: PoseAt,
        directions: Floats,
        range_m: Floats,
        sigma_m: Floats,
        image: Appearance | None = None,
    ) -> None:
        """Add the ranges (S,) along unit vectors (S, 3), nan where there is none.

        Points that they show to be gone are dropped; those of the same place are fused.
        """
        with np.errstate(invalid="ignore"):
            usable = (range_m > NEAREST_M) & (sigma_m < MAX_LOG_SIGMA * range_m)
        if not usable.any():
            return
        directions, range_m, sigma_m = directions[usable], range_m[usable], sigma_m[usable]
        count, pixel = len(range_m), pixel_of(directions, self._optics, self._shape)
        new = Points(
            pose.position_m + (directions * range_m[:, None]) @ pose.axes.T,
            (sigma_m / range_m) ** 2,
            np.full(count, pose.time_s),
            np.full(count, pose.variance_m2),
            np.full(count, pose.variance_rad2),
            range_m * directions[:, 2],
            np.full(count, np.nan) if image is None else image.at(pixel),
        )
        seen, met = self.seen(pose, hidden=True), self._seen(pose, new)
        gone = self._gone(seen, met)
        fused = self._fused(seen, met, new, gone)
        kept = np.ones(len(self.points), dtype=bool)
        kept[seen.index[gone]] = False
        kept[fused] = False
        every = self.points[kept] + new
        self.points = every[np.argsort(every.time_s, kind="stable")[-MAX_POINTS:]]

    def forget_behind(self, pose: PoseAt, directions: Floats, range_m: Floats) -> None:
        """Drop the points behind things at ranges (S,) along unit vectors (S, 3)."""
        seen = self.seen(pose, hidden=True)
        close = distances(seen.pixel, pixel_of(directions, self._optics, self._shape))
        farther = seen.log_depth[:, None] - np.log(range_m * directions[:, 2])
        behind = ((close < BEHIND_PIXELS) & (farther > BEHIND_LOG)).any(axis=1)
        self.points = self.points[np.delete(np.arange(len(self.points)), seen.index[behind])]

    def seen(self, pose: PoseAt, image: Appearance | None = None, *, hidden: bool = False) -> Seen:
        """Points in the view of a pose; those behind others only if ``hidden``.

        Points that do not look as they did in the ``image`` are not what is seen there.
        """
        seen = self._seen(pose, self.points)
        if image is not None and len(seen.index):
            then = self.points[seen.index]
            nearer = then.depth_m / np.exp(seen.log_depth)
            changed = image.differs(seen.pixel, then.brightness, nearer, seen.pixel_variance)
            seen = seen[~changed]
        if hidden or len(seen.index) < 2:
            return seen
        visible = np.ones(len(seen.index), dtype=bool)
        visible[self._behind(seen, pose.time_s)] = False
        return seen[visible]

    def _behind(self, seen: Seen, time_s: float) -> NDArray[np.intp]:
        """Which of the points seen others hide; ranges of this frame, at ``time_s``, hide more."""
        from scipy.spatial import KDTree  # slow to load

        near, far = KDTree(seen.pixel).query_pairs(BEHIND_PIXELS, output_type="ndarray").T
        swapped = seen.log_depth[near] > seen.log_depth[far]
        near, far = np.where(swapped, far, near), np.where(swapped, near, far)
        farther = seen.log_depth[far] - seen.log_depth[near]
        close = np.hypot(*(seen.pixel[near] - seen.pixel[far]).T) < HIDDEN_PIXELS
        now = self.points.time_s[seen.index] == time_s
        appeared = now[near] & ~now[far] & (farther > BEHIND_LOG)
        return far[close & (farther > HIDDEN_LOG) | appeared]

    def _seen(self, pose: PoseAt, points: Points) -> Seen:
        local_m = (points.position_m - pose.position_m) @ pose.axes
        index = np.flatnonzero(local_m[:, 2] > NEAREST_M)
        pixel = pixel_of(local_m[index], self._optics, self._shape)
        inside = in_view(pixel, self._shape)
        index, pixel = index[inside], pixel[inside]
        depth_m = local_m[index, 2]
        between_m2, between_rad2 = pose.since(
            points.time_s[index], points.pose_variance_m2[index], points.pose_variance_rad2[index]
        )
        relative = between_m2 / depth_m**2
        return Seen(
            index,
            pixel,
            np.log(depth_m),
            points.log_variance[index] + relative,
            self._pixels_per_rad**2 * (relative + between_rad2),
        )

    def _gone(self, seen: Seen, met: Seen) -> Mask:
        """Which of the points seen are gone, as spots meet something farther."""
        apart = distances(seen.pixel, met.pixel)
        farther = met.log_depth - seen.log_depth[:, None]
        sigma = np.sqrt(met.log_variance + seen.log_variance[:, None])
        blur = np.sqrt(seen.pixel_variance)[:, None]
        through = (apart + blur < CARVED_PIXELS) & (farther > CARVED_SIGMAS * sigma + CARVED_LOG)
        gone = np.asarray(through.any(axis=1))
        if gone.any():
            beside = distances(seen.pixel, seen.pixel[gone]) < NEIGHBOUR_PIXELS
            alike = np.abs(seen.log_depth[:, None] - seen.log_depth[gone]) < NEIGHBOUR_LOG
            gone |= (beside & alike).any(axis=1)
        return gone

    def _fused(self, seen: Seen, met: Seen, new: Points, gone: Mask) -> NDArray[np.intp]:
        """Indices of the points that went into new ones of the same place."""
        apart = distances(seen.pixel, met.pixel)
        off = np.abs(seen.log_depth[:, None] - met.log_depth)
        sigma = np.sqrt(met.log_variance + seen.log_variance[:, None])
        same = (apart < SAME_PIXELS) & (off < SAME_SIGMAS * sigma) & ~gone[:, None]
        rows, columns = np.nonzero(same)
        for row, column in zip(rows, columns, strict=True):
            old = seen.index[row]
            weight = new.log_variance[column] / (new.log_variance[column] + seen.log_variance[row])
            new.position_m[column] += weight * (
                self.points.position_m[old] - new.position_m[column]
            )
            new.log_variance[column] *= 1 - weight
        return seen.index[rows]
