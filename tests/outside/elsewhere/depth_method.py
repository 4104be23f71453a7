"""A depth method: a wall straight ahead."""

import numpy as np


class Flat:
    title = "flat wall"
    needs = ("optics", "spots")

    def compile(self, context):
        shape, forward = context.setup.plan.shape, context.setup.spots.directions[:, 2]
        return lambda view: np.full(shape, np.nanmean(view.ranges.range_m * forward))


METHOD = Flat()
