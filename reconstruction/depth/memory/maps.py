"""Map of the last frames in the view of this one: their depth maps, carried by pose and averaged.

The errors of maps of successive frames are not the same, as their readings are not. Each pixel of
the new map finds its place in the last average; where both agree, the average takes a fraction of
the new map, elsewhere it begins anew: there something moved, or came into view. So it does where
the image is no longer as bright as it was.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...base.arrays import Floats
from ...capture import Optics
from ...capture.motion import PoseAt
from ..pixels import in_view, pixel_rays, seen_before

if TYPE_CHECKING:
    from .appearance import Appearance

NEW = 0.15
"""Fraction that the new map has in the average."""
MAX_SIGMAS = 3.0
"""Maximum difference between average and map, in standard deviations of the map."""


class Average(NamedTuple):
    """Averages of ln depth and of brightness, (H, W), in a view."""

    pose: PoseAt
    log_depth: Floats
    brightness: Floats


class MapMemory:
    """Average of ln depth (H, W) over frames."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._optics, self._shape = optics, shape
        self._rays = pixel_rays(optics, shape)
        self._pixels = np.indices(shape, dtype=np.float64).reshape(2, -1).T
        self._last: Average | None = None

    def take(self, pose: PoseAt, log_depth: Floats, sigma: Floats, seen: "Appearance") -> Floats:
        """The average with a new map of ln depth (H, W) of standard deviation ``sigma``."""
        new = Average(pose, log_depth, np.maximum(seen.image, 0))
        self._last = new if self._last is None else self._averaged(self._last, new, sigma, seen)
        return self._last.log_depth

    def _averaged(self, last: Average, new: Average, sigma: Floats, seen: "Appearance") -> Average:
        points_m = self._rays * np.exp(new.log_depth)[..., None]
        pixel, local_m = seen_before(last.pose, new.pose, points_m, self._optics, self._shape)
        there, was = (sampled(each, pixel) for each in (last.log_depth, last.brightness))
        carried = there.reshape(self._shape) + new.log_depth - np.log(local_m[..., 2])
        agrees = np.abs(carried - new.log_depth) < MAX_SIGMAS * sigma
        kept = in_view(pixel, self._shape)
        kept &= ~seen.differs(self._pixels, was)
        agrees &= kept.reshape(self._shape)
        log_depth, brightness = (
            np.where(agrees, NEW * now + (1 - NEW) * before, now)
            for now, before in (
                (new.log_depth, carried),
                (new.brightness, was.reshape(self._shape)),
            )
        )
        return Average(new.pose, log_depth, brightness)


def sampled(image: Floats, pixel: Floats) -> Floats:
    """Values (N,) at fractional rows and columns (N, 2), bilinear; beyond the edges, that there."""
    last = np.array(image.shape) - 1
    within = np.clip(pixel, 0, last)
    first = np.minimum(within.astype(np.intp), last - 1)
    (down, along), flat = (within - first).T, image.ravel()
    corner = first[:, 0] * image.shape[1] + first[:, 1]
    above = flat[corner] + along * (flat[corner + 1] - flat[corner])
    corner += image.shape[1]
    below = flat[corner] + along * (flat[corner + 1] - flat[corner])
    return np.asarray(above + down * (below - above))
