"""The stated error of a pixel of the image, and of a path-length bin of a spot.

The spread of n launches estimates the variance of their mean without bias, but with only n - 1
degrees of freedom. It does worse where rare bright paths dominate the variance: a pixel that has
met none is too dark, and its stated error is too small besides. Its neighbours meet such paths as
often as it does. The mean variance around a cell therefore counts as some more degrees of freedom:
a moderated variance (Smyth, Stat. Appl. Genet. Mol. Biol. 3(1), 3 (2004), §4), with the prior taken
around each cell,

    s² = ((n - 1) s²_own + d s²_around) / (n - 1 + d)

Means over a window preserve the sum over all cells, and with it the rms error of the whole. A cell
whose neighbours have no variance states up to 6 % less than its error if it is a pixel, and 12 % if
it is a bin; its neighbours state more.
"""

from typing import NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.sampling import Estimate


class Around(NamedTuple):
    """The window around a cell whose mean variance counts."""

    window: tuple[int, int]  # rows and columns, the cell itself in the middle
    degrees: float  # of freedom that it counts as


#: Chosen by how many estimates lie within 1, 2 and 4 stated errors (docs/theory/transport.md).
PIXELS = Around((3, 3), 1.0)
#: A bin, 2 cm of a path or less, is lit by fewer paths than a pixel.
BINS = Around((1, 33), 2.0)


def image_error(result: Estimate, shape: tuple[int, int]) -> Floats:
    """Standard error of each pixel (H, W) of an estimated `image` (H·W,)."""
    return moderated(result.error["image"].reshape(shape), result.launches, PIXELS)


def spot_error(result: Estimate) -> Floats:
    """Standard error of each bin (spots, bins) of an estimated `histogram`."""
    return moderated(result.error["histogram"], result.launches, BINS)


def moderated(error: Floats, launches: int, around: Around) -> Floats:
    """Standard errors (rows, columns) of means over launches, moderated by their neighbours."""
    from scipy.ndimage import convolve  # slow to import

    own, degrees = error**2, launches - 1
    mean = np.full(around.window, 1 / np.prod(around.window))
    beside = convolve(own, mean, mode="reflect")  # mirrored at the border
    total = degrees * own + around.degrees * beside
    return np.asarray(np.sqrt(total / (degrees + around.degrees)))
