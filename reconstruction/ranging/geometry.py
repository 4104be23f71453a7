"""From the length of a path to the range on a ray."""

import numpy as np

from ..base.arrays import Floats


def range_from_path(
    path_m: Floats, directions: Floats, detector_positions_m: Floats
) -> tuple[Floats, Floats]:
    """Range r (...,) along unit directions d (..., 3) from the path r + |r d - b|; its derivative.

    r = (L^2 - |b|^2) / 2 (L - d.b), dr/dL = (L - r) / (L - d.b), b (..., 3) the detector's
    position. Only L > |b| is the length of a path.
    """
    squared = (detector_positions_m**2).sum(axis=-1)
    along = (directions * detector_positions_m).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (path_m**2 - squared) / (2 * (path_m - along))
        return range_m, (path_m - range_m) / (path_m - along)
