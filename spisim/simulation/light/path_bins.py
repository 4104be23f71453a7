"""Path-length bins for the light of the spots: fine near by and around far surfaces.

Up to NEAR_PATH_M bins are BIN_WIDTH_M wide, and narrower where an instrument times edges too short
for that, up to the longest path that it tells apart. Beyond, only surfaces return light, and bins
widen in proportion to the path, except around the path to the surface that a laser meets, where
they are fine again. A wall at 3 km takes a few thousand bins, not 300,000. Light between two bins
is split so that its mean path length is exact; light beyond the last bin counts in the last bin.
"""

import math

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument.tof import Tof, path_step_m
from spisim.transport.engine.tally import PathLengthBins

BIN_WIDTH_M = 0.02
#: Minimum width for the shortest edges.
MIN_BIN_WIDTH_M = 0.001
#: Bins beyond the longest path whose light a measured response may still bring forward.
LATE_BINS = 40
#: Fog tails beyond this path length are negligible.
NEAR_PATH_M = 80.0
#: Width of the bins beyond, relative to their path length.
FAR_WIDTH = 0.01
#: Half width of the fine bins about the path to a surface, over what a spot covers of a slope.
AROUND_M = 10.0
#: Longest resolved path length, known to 2 mm in single precision.
LONGEST_PATH_M = 20_000.0


def bins_for(tof: Tof, spot_range_m: Floats) -> PathLengthBins:
    """Bins for lasers or zones of this method, whose axes meet surfaces at these ranges."""
    return spot_bins(spot_range_m, tof.unambiguous_range_m, path_step_m(tof))


def spot_bins(
    spot_range_m: Floats, unambiguous_range_m: float, step_m: float = BIN_WIDTH_M
) -> PathLengthBins:
    """Bins for lasers whose axes meet surfaces at these ranges, nan for none.

    They also cover the longest path that the instrument can tell apart, and are no wider than
    `step_m` up to it.
    """
    parts = max(math.ceil(BIN_WIDTH_M / max(step_m, MIN_BIN_WIDTH_M)), 1)
    step_m = BIN_WIDTH_M / parts
    told_apart_m = 2 * unambiguous_range_m + LATE_BINS * step_m
    near_m = NEAR_PATH_M
    if parts > 1:
        near_m = min(BIN_WIDTH_M * math.ceil(min(told_apart_m, 1e9) / BIN_WIDTH_M), NEAR_PATH_M)
    near = PathLengthBins.up_to(near_m, step_m)
    lengths = 2 * np.asarray(spot_range_m, np.float64)
    lengths = lengths[(lengths > NEAR_PATH_M - AROUND_M) & (lengths < LONGEST_PATH_M - AROUND_M)]
    longest = max([NEAR_PATH_M, 2 * unambiguous_range_m, *(lengths + AROUND_M)])
    steps = np.log(min(longest, LONGEST_PATH_M) / NEAR_PATH_M) / np.log1p(FAR_WIDTH)
    coarse = NEAR_PATH_M * (1 + FAR_WIDTH) ** np.arange(1, np.ceil(steps) + 1)
    between = np.arange(near_m, NEAR_PATH_M + BIN_WIDTH_M / 2, BIN_WIDTH_M)
    fine = [
        np.arange(
            length - AROUND_M, length + AROUND_M, step_m if length < told_apart_m else BIN_WIDTH_M
        )
        for length in lengths.tolist()
    ]
    even = BIN_WIDTH_M * np.rint(np.concatenate([between, coarse]) / BIN_WIDTH_M)
    numbers = np.unique(np.rint(np.concatenate([even, *fine]) / step_m))
    return PathLengthBins(
        near.near, step_m, tuple((step_m * numbers[numbers >= near.near]).tolist())
    )


def split_light(path_m: Floats, light: Floats, lengths_m: Floats) -> Floats:
    """Light (bins,) of paths (n,), split between the two bins about each as transport splits it."""
    low = np.clip(np.searchsorted(lengths_m, path_m, "right") - 1, 0, lengths_m.size - 2)
    upper = np.clip((path_m - lengths_m[low]) / (lengths_m[low + 1] - lengths_m[low]), 0, 1)
    parts = (
        np.bincount(low + k, light * each, lengths_m.size)
        for k, each in ((0, 1 - upper), (1, upper))
    )
    return np.asarray(sum(parts))
