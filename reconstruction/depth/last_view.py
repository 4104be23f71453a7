"""What of a frame is seen from the next one, by their poses and a depth map."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..capture import Optics
from ..capture.motion import PoseAt, break_between
from .method import MAX_RANGE_M
from .pixels import MIN_DEPTH_M, pixel_rays, seen_before


class LastView:
    """The frame just before this one: its pose, and its depth map in place of this one's."""

    def __init__(self, optics: Optics | None, shape: tuple[int, int]) -> None:
        self._optics, self._shape = optics, shape
        self._now: PoseAt | None = None
        self._last: tuple[PoseAt, NDArray[np.floating]] | None = None
        self._next: tuple[PoseAt, NDArray[np.floating]] | None = None

    def turn_to(self, pose: PoseAt | None) -> None:
        """Another frame begins, at this pose if it has one."""
        self._last, self._next, self._now = self._next, None, pose

    def keep(self, depth_m: NDArray[np.floating] | None) -> None:
        """The frame ends, with this map (H, W); where it has no depth, all is far away."""
        if depth_m is None:
            depth_m = np.full(self._shape, MAX_RANGE_M)
        depth_m = np.clip(np.nan_to_num(depth_m, nan=MAX_RANGE_M), MIN_DEPTH_M, MAX_RANGE_M)
        self._next = None if self._now is None else (self._now, depth_m)

    def motion(self) -> Callable[[NDArray[Any]], NDArray[Any]] | None:
        """From images (N, H, W) to how they are seen and lit from here; None without both poses."""
        if self._optics is None or self._now is None or self._last is None:
            return None
        before, depth_m = self._last
        if break_between(before, self._now) is not None:
            return None
        from scipy.ndimage import map_coordinates  # slow to load

        points_m = pixel_rays(self._optics, self._shape) * depth_m[..., None]
        pixel, local_m = seen_before(before, self._now, points_m, self._optics, self._shape)
        nearer = np.linalg.norm(local_m, axis=-1) / np.linalg.norm(points_m, axis=-1)

        def move(images: NDArray[Any]) -> NDArray[Any]:
            carried = [map_coordinates(each, pixel.T, order=3, mode="nearest") for each in images]
            return np.reshape(carried, images.shape) * nearer**2

        return move
