"""Bins of path length for the light of the four spots: fine near by and around what is far.

Up to NEAR_PATH_M all are BIN_WIDTH_M wide. Beyond, where only surfaces return anything, they widen
in proportion to the path, but around the path to whatever a laser meets, where they are fine again:
a wall at 3 km takes a few thousand bins, not 300,000. Between two bins light is shared so that its
mean path length is kept; beyond the last one it counts as there.
"""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.tally import PathLengthBins

BIN_WIDTH_M = 0.02
#: Fog tails beyond this are nothing, and nothing is fine in them.
NEAR_PATH_M = 80.0
#: Width of the bins beyond, over their path length.
FAR_WIDTH = 0.01
#: They are fine this far about a path to a surface and back: over what a spot covers of a slope.
AROUND_M = 10.0
#: Longest path told apart: single precision knows it to 2 mm.
LONGEST_PATH_M = 20_000.0


def spot_bins(spot_range_m: Floats, unambiguous_range_m: float) -> PathLengthBins:
    """Bins for lasers whose axes meet something at these ranges, nan for nothing.

    They reach to the longest path that the instrument tells apart, too.
    """
    lengths = 2 * np.asarray(spot_range_m, np.float64)
    lengths = lengths[(lengths > NEAR_PATH_M - AROUND_M) & (lengths < LONGEST_PATH_M - AROUND_M)]
    longest = max([2 * unambiguous_range_m, *(lengths + AROUND_M)])
    near = PathLengthBins.up_to(NEAR_PATH_M, BIN_WIDTH_M)
    if longest <= NEAR_PATH_M:
        return near
    steps = np.log(min(longest, LONGEST_PATH_M) / NEAR_PATH_M) / np.log1p(FAR_WIDTH)
    coarse = NEAR_PATH_M * (1 + FAR_WIDTH) ** np.arange(1, np.ceil(steps) + 1)
    fine = [
        np.arange(length - AROUND_M, length + AROUND_M, BIN_WIDTH_M) for length in lengths.tolist()
    ]
    numbers = np.unique(np.rint(np.concatenate([coarse, *fine]) / BIN_WIDTH_M))
    far_m = BIN_WIDTH_M * numbers[numbers >= near.near]
    return PathLengthBins(near.near, near.width_m, tuple(far_m.tolist()))
