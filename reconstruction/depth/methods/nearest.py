"""The baseline: each pixel takes the range of the nearest spot that has one."""

import numpy as np

from ...arrays import Floats
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..rays import pixel_of, range_over_depth, squared_distances


class Nearest:
    """Range of the nearest valid spot."""

    title = "nearest spot"
    needs: tuple[Need, ...] = ("optics", "spots")

    def compile(self, context: Context) -> DepthSolver:
        """Solver of one recording's frames."""
        setup = context.setup
        assert setup.optics is not None
        assert setup.spots is not None
        shape = setup.plan.shape
        anchors = pixel_of(setup.spots.directions, setup.optics, shape)
        stretch = range_over_depth(setup.optics, shape)

        def solve(view: View) -> DepthEstimate | None:
            if view.ranges is None:
                return None
            range_m = nearest_range(shape, anchors, view.ranges.range_m)
            return None if range_m is None else DepthEstimate(range_m / stretch)

        return solve


def nearest_range(shape: tuple[int, int], anchors: Floats, range_m: Floats) -> Floats | None:
    """Range of the nearest valid anchor in each pixel, (H, W). None without one."""
    usable = np.isfinite(range_m) & (range_m > 0)
    if not usable.any():
        return None
    return range_m[usable][np.argmin(squared_distances(shape, anchors[usable]), axis=-1)]


METHOD = Nearest()
