"""The error that is stated for a pixel of the image, and for a path-length bin of a spot.

The spread of n launches tells the variance of their mean without bias, but with n - 1 degrees of
freedom only. Where most of the variance is that of rare bright paths it does worse: a pixel that
has met none is too dark, and states an error that is too small besides. The cells around it meet
such paths as often as it does. So the mean variance around a cell counts as some degrees of freedom
more: a moderated variance (Smyth, Stat. Appl. Genet. Mol. Biol. 3(1), 3 (2004), §4), with the prior
taken around each cell,

    s² = ((n - 1) s²_own + d s²_around) / (n - 1 + d)

Means over a window keep the sum over all cells, and with it the error of the whole in the rms. A
cell whose neighbours have none of its variance states up to 6 % less than its error if it is a
pixel, 12 % if it is a bin, and they state more.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.sampling import Estimate


class Around(NamedTuple):
    """Cells whose mean variance counts."""

    window: tuple[int, int]  # rows and columns, the cell itself in the middle
    degrees: float  # of freedom that it counts as


#: Chosen by how many estimates lie within 1, 2 and 4 stated errors (docs/theory/transport.md).
PIXELS = Around((3, 3), 1.0)
#: A bin, 2 cm of a path, is lit by fewer paths than a pixel.
BINS = Around((1, 33), 2.0)


def image_error(result: Estimate, shape: tuple[int, int]) -> Floats:
    """Of each pixel (H, W) of an estimated `image` (H·W,)."""
    return moderated(result.error["image"].reshape(shape), result.launches, PIXELS)


def spot_error(result: Estimate) -> Floats:
    """Of each bin (spots, bins) of an estimated `histogram`."""
    return moderated(result.error["histogram"], result.launches, BINS)


def moderated(error: Floats, launches: int, around: Around) -> Floats:
    """Standard errors (rows, columns) of means of so many launches, by what is around as well."""
    from scipy.ndimage import convolve  # slow to import

    own, degrees = error**2, launches - 1
    mean = np.full(around.window, 1 / np.prod(around.window))
    beside = convolve(own, mean, mode="reflect")  # at the border, what a mirror there shows
    total = degrees * own + around.degrees * beside
    return np.asarray(np.sqrt(total / (degrees + around.degrees)))
