"""Depth methods that use the valid spots alone, not the image."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Floats
from .method import Context, DepthEstimate, DepthSolver, Need, View
from .pixels import pixel_of, range_over_depth, squared_distances


@dataclass(frozen=True)
class BetweenSpots:
    """Ranges (H, W) by ``between``, from squared distances (H, W, K) in pixels and ranges (K,)."""

    title: str
    between: Callable[[Floats, Floats], Floats]
    needs: tuple[Need, ...] = ("optics", "spots")

    def compile(self, context: Context) -> DepthSolver:
        setup = context.setup
        assert setup.optics is not None
        optics, shape = setup.optics, setup.plan.shape
        stretch = range_over_depth(optics, shape)

        def solve(view: View) -> DepthEstimate | None:
            if view.ranges is None:
                return None
            anchors = pixel_of(view.directions, optics, shape)
            range_m = self.ranges(shape, anchors, view.ranges.range_m)
            return None if range_m is None else DepthEstimate(range_m / stretch)

        return solve

    def ranges(self, shape: tuple[int, int], anchors: Floats, range_m: Floats) -> Floats | None:
        """Range in each pixel, (H, W), from the valid anchors (K, 2); None without one."""
        usable = np.isfinite(range_m) & (range_m > 0)
        if not usable.any():
            return None
        return self.between(squared_distances(shape, anchors[usable]), range_m[usable])
