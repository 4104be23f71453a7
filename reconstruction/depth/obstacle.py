"""How far ahead the nearest obstacle is."""

import numpy as np

from ..arrays import Floats
from .method import REACH_M

CORRIDOR_M = 0.6
"""Width and height of the corridor along the optical axis in which a drone flies."""
OBSTACLE_M2 = 0.01
"""Cross-section of what counts as an obstacle: that of a hand's breadth squared."""


def nearest_obstacle(depth_m: Floats, rays: Floats, *, chance: Floats | None = None) -> float:
    """Depth within reach of the nearest obstacle in the corridor, nan without one.

    The corridor runs along the optical axis, CORRIDOR_M wide and high. An obstacle is there from
    the depth on up to which the pixels (H, W) in it make up OBSTACLE_M2 together, each as large as
    it is at its depth, times the ``chance`` (H, W) that something is there: single pixels that are
    wrong count for little, and so do wires. ``rays`` (H, W, 3) are those of `pixel_rays`.
    """
    inside = (depth_m <= REACH_M) & (np.abs(rays[..., :2]).max(axis=-1) * depth_m <= CORRIDOR_M / 2)
    order = np.argsort(depth_m[inside])
    sorted_m = depth_m[inside][order]
    height, width = depth_m.shape
    across, down = (np.ptp(rays[..., k]) / max(n - 1, 1) for k, n in enumerate((width, height)))
    pixel = (across or down) * (down or across)  # at 1 m
    area = pixel * sorted_m**2
    if chance is not None:
        area *= chance[inside][order]
    enough = np.cumsum(area) >= OBSTACLE_M2
    return float(sorted_m[enough.argmax()]) if enough.any() else float("nan")
