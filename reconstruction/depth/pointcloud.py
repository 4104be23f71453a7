"""Point clouds as binary PLY."""

import numpy as np

from ..base.arrays import Floats
from ..base.files import mark


def point_cloud_ply(points_m: Floats, image: Floats) -> bytes:
    """Binary little-endian PLY of points (..., 3) in metres, the image (...) as their grey colour.

    Points that are not finite are left out. The image is scaled from 0 to its brightest pixel.
    """
    finite = np.isfinite(points_m).all(axis=-1)
    points, grey = points_m[finite], image[finite]
    brightest = float(grey.max(initial=0.0)) or 1.0
    colour = np.clip(255 * (grey / brightest), 0, 255).astype(np.uint8)
    vertices = np.empty(len(points), dtype=[("position", "<f4", 3), ("colour", "u1", 3)])
    vertices["position"] = points
    vertices["colour"] = colour[:, None]
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {mark('point cloud')}\n"
        "comment metres; x right, y down, z forward; origin at the projector\n"
        f"element vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    )
    return header.encode() + vertices.tobytes()
