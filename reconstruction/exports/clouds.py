"""Points with the image as their intensity."""

import numpy as np
from numpy.typing import NDArray

from .shot import Shot

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])


def organised(shot: Shot) -> NDArray[np.void]:
    """Points (H, W) of `POINT`: metres in the optical frame, nan without depth; image values."""
    points = np.empty(shot.shape, POINT)
    for axis, values in zip("xyz", np.moveaxis(shot.points_m, -1, 0), strict=True):
        points[axis] = values
    points["intensity"] = shot.image
    return points
