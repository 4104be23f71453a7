"""A depth method: a wall straight ahead."""

import numpy as np

from reconstruction.depth import DepthEstimate


class Flat:
    title = "flat wall"
    needs = ("optics", "spots")

    def compile(self, context):
        shape, forward = context.setup.plan.shape, context.setup.spots.directions[:, 2]

        def solve(view):
            depths_m = view.ranges.range_m * forward
            if not np.isfinite(depths_m).any():
                return None
            spread = np.full(shape, np.nanstd(np.log(depths_m)))
            return DepthEstimate(np.full(shape, np.nanmean(depths_m)), sigma=spread)

        return solve


METHOD = Flat()
