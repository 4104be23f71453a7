"""Map of the last frames in the view of this one: their depth maps, carried by pose and averaged.

The errors of maps of successive frames are not the same, as their readings are not. Each pixel of
the new map finds its place in the last average; where both agree, the average takes a fraction of
the new map, elsewhere it begins anew: there something moved, or came into view. So it does where
the image is no longer as bright as it was.
"""

from typing import TYPE_CHECKING

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


class MapMemory:
    """Average of ln depth (H, W) over frames."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._optics, self._shape = optics, shape
        self._rays = pixel_rays(optics, shape)
        self._last: tuple[PoseAt, Floats, Floats | None] | None = None

    def take(
        self, pose: PoseAt, log_depth: Floats, sigma: Floats, image: "Appearance | None" = None
    ) -> Floats:
        """The average with a new map of ln depth (H, W) of standard deviation ``sigma``."""
        brightness = None
        if image is not None:
            pixel = np.indices(self._shape).reshape(2, -1).T
            brightness = image.at(pixel, np.exp(log_depth).ravel()).reshape(self._shape)
        if self._last is not None:
            log_depth, brightness = self._averaged(*self._last, pose, log_depth, sigma, image, brightness)
        self._last = pose, log_depth, brightness
        return log_depth

    def _averaged(
        self, before: PoseAt, last: Floats, then, pose: PoseAt, log_depth: Floats, sigma: Floats, image, brightness
    ) -> Floats:
        points_m = self._rays * np.exp(log_depth)[..., None]
        pixel, local_m = seen_before(before, pose, points_m, self._optics, self._shape)
        inside = in_view(pixel, last.shape)
        carried = sampled(last, pixel).reshape(last.shape) + log_depth - np.log(local_m[..., 2])
        agrees = np.abs(carried - log_depth) < MAX_SIGMAS * sigma
        agrees &= inside.reshape(last.shape)
        if image is not None:
            was = sampled(then, pixel)
            every = np.indices(self._shape).reshape(2, -1).T
            agrees &= ~image.differs(every, np.exp(carried).ravel(), was).reshape(last.shape)
            brightness = np.where(agrees, NEW * brightness + (1 - NEW) * was.reshape(last.shape), brightness)
        return np.where(agrees, NEW * log_depth + (1 - NEW) * carried, log_depth), brightness


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
