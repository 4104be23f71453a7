"""The usual interpolation: the mean of the spots' ranges, weighted by inverse squared distance.

D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data", Proc. 23rd ACM
National Conference, 517 (1968). It knows nothing of the image: what a method that does is worth is
told by comparison.
"""

import numpy as np

from ...arrays import Floats
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..rays import pixel_of, range_over_depth, squared_distances

LEAST = 1e-6
"""Squared distance in pixels that a pixel has from a spot, at least."""


class InverseDistance:
    """Ranges of all valid spots, the nearer the more."""

    title = "inverse distance"
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
            range_m = weighted_range(shape, anchors, view.ranges.range_m)
            return None if range_m is None else DepthEstimate(range_m / stretch)

        return solve


def weighted_range(shape: tuple[int, int], anchors: Floats, range_m: Floats) -> Floats | None:
    """Mean range (H, W) of the valid anchors (K, 2), by distance. None without one."""
    usable = np.isfinite(range_m) & (range_m > 0)
    if not usable.any():
        return None
    weights = 1 / np.maximum(squared_distances(shape, anchors[usable]), LEAST)
    return np.asarray(weights @ range_m[usable] / weights.sum(axis=-1))


METHOD = InverseDistance()
