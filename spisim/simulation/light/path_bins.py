"""Path-length bins for the light of the spots: fine near by and around far surfaces.

Up to NEAR_PATH_M bins are BIN_WIDTH_M wide. Beyond, only surfaces return light, and bins widen in
proportion to the path, except around the path to the surface that a laser meets, where they are
fine again. A wall at 3 km takes a few thousand bins, not 300,000. Light between two bins is split
so that its mean path length is exact; light beyond the last bin counts in the last bin.
"""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.tally import PathLengthBins

BIN_WIDTH_M = 0.02
#: Fog tails beyond this path length are negligible.
NEAR_PATH_M = 80.0
#: Width of the bins beyond, relative to their path length.
FAR_WIDTH = 0.01
#: Half width of the fine bins about the path to a surface, over what a spot covers of a slope.
AROUND_M = 10.0
#: Longest resolved path length, known to 2 mm in single precision.
LONGEST_PATH_M = 20_000.0


def spot_bins(spot_range_m: Floats, unambiguous_range_m: float) -> PathLengthBins:
    """Bins for lasers whose axes meet surfaces at these ranges, nan for none.

    They also cover the longest path that the instrument can tell apart.
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
