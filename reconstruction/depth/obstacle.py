"""How far ahead the nearest obstacle is."""

import numpy as np

from ..arrays import Floats
from .method import REACH_M

CORRIDOR_M = 0.6
"""Width and height of the corridor along the optical axis in which a drone flies."""
OBSTACLE_M2 = 0.01
"""Cross-section of what counts as an obstacle: that of a hand's breadth squared."""


class Corridor:
    """What lies ahead, CORRIDOR_M wide and high, along the optical axis of pixels with ``rays``.

    Rays (H, W, 3) are those of `pixel_rays`.
    """

    def __init__(self, rays: Floats) -> None:
        self._slope = np.abs(rays[..., :2]).max(axis=-1)
        height, width = self._slope.shape
        across, down = (np.ptp(rays[..., k]) / max(n - 1, 1) for k, n in enumerate((width, height)))
        self._pixel = (across or down) * (down or across)  # at 1 m

    def nearest_m(self, depth_m: Floats, chance: Floats | None = None) -> float:
        """Depth within reach of the nearest obstacle, nan without one.

        It is there from the depth on up to which the pixels (H, W) in the corridor make up
        OBSTACLE_M2 together, each as large as it is at its depth, times the ``chance`` (H, W) that
        something is there: single pixels that are wrong count for little, and so do wires.
        """
        inside = (depth_m <= REACH_M) & (self._slope * depth_m <= CORRIDOR_M / 2)
        found_m = depth_m[inside]
        order = np.argsort(found_m)
        area = self._pixel * found_m[order] ** 2
        if chance is not None:
            area *= chance[inside][order]
        enough = np.searchsorted(np.cumsum(area), OBSTACLE_M2)
        return float(found_m[order[enough]]) if enough < order.size else float("nan")
