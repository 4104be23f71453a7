"""Images and depth maps as PNG files, and depth maps as point clouds."""

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..base.files import mark
from ..base.png import png
from .export import KIND
from .shot import Shot

MAX_MM = 2**16 - 1
"""Greater depths are treated as unknown."""
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])


def depth_png(depth_m: NDArray[np.floating] | None, shape: tuple[int, int]) -> bytes:
    """Depth (H, W) along the optical axis in whole millimetres, 16 bits; 0 where unknown."""
    millimetres = np.zeros(shape, np.uint16)
    if depth_m is not None:
        finite = np.isfinite(depth_m) & (depth_m <= MAX_MM / 1000)
        millimetres[finite] = np.rint(1000 * depth_m[finite].astype(np.float64))
    return png(millimetres, mark(KIND))


def colour_png(image: NDArray[np.floating]) -> bytes:
    """Grey image (H, W) from 0 to its brightest pixel, 8 bits per colour."""
    brightest = max(float(image.max()), np.finfo(np.float64).tiny)
    grey = np.clip(np.rint(255 * image / brightest), 0, 255).astype(np.uint8)
    return png(np.repeat(grey[..., None], 3, axis=-1), mark(KIND))


def require_depths(depth_maps: int, shots: int) -> None:
    """Raise InputError unless any shot has a depth map."""
    if not shots:
        raise InputError("there is nothing to export")
    if not depth_maps:
        raise InputError("there is no depth map: no spot has a range, or the optics are unknown")


def organised(shot: Shot) -> NDArray[np.void]:
    """Points (H, W) of `POINT`: metres in the optical frame, nan without depth; image values."""
    points = np.empty(shot.shape, POINT)
    for axis, values in zip("xyz", np.moveaxis(shot.points_m, -1, 0), strict=True):
        points[axis] = values
    points["intensity"] = shot.image
    return points
