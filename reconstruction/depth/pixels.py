"""Virtual pixels: rays, positions of spots among them, local means, and point clouds."""

import numpy as np

from ..base.arrays import Floats, Mask
from ..base.files import mark
from ..capture import Optics
from ..capture.motion import PoseAt

MIN_DEPTH_M = 0.05
"""Depth of points that come to lie beside the camera or behind it."""


def pixel_rays(optics: Optics, shape: tuple[int, int]) -> Floats:
    """Directions through the pixel centres, scaled to z = 1.

    A depth times a ray is a point; the ray's length is range over depth.

    Parameters
    ----------
    optics
        Projector's pinhole model.
    shape
        Rows H and columns W.

    Returns
    -------
    ndarray
        Rays (H, W, 3): x right, y down, z forward.
    """
    height, width = shape
    x = (2 * np.arange(width) + 1 - width) / width * optics.tan_half_width
    y = (2 * np.arange(height) + 1 - height) / height * optics.tan_half_height
    rays = np.ones((height, width, 3))
    rays[..., 0], rays[..., 1] = x, y[:, None]
    return rays


def pixel_of(directions: Floats, optics: Optics, shape: tuple[int, int]) -> Floats:
    """Row and column (K, 2) of directions (K, 3), fractional, with pixel centres at integers."""
    height, width = shape
    row = directions[:, 1] / directions[:, 2] / optics.tan_half_height
    column = directions[:, 0] / directions[:, 2] / optics.tan_half_width
    return np.stack([(row + 1) * height / 2 - 0.5, (column + 1) * width / 2 - 0.5], axis=1)


def seen_before(
    before: PoseAt, pose: PoseAt, points_m: Floats, optics: Optics, shape: tuple[int, int]
) -> tuple[Floats, Floats]:
    """Points (..., 3) of a frame in an earlier one: rows and columns (N, 2), coordinates."""
    turn = pose.axes.T @ before.axes
    local_m = points_m @ turn + (pose.position_m - before.position_m) @ before.axes
    local_m[..., 2] = np.maximum(local_m[..., 2], MIN_DEPTH_M)
    return pixel_of(local_m.reshape(-1, 3), optics, shape), local_m


def in_view(pixels: Floats, shape: tuple[int, ...]) -> Mask:
    """Which rows and columns (K, 2) lie within an image (H, W)."""
    return np.asarray(((pixels > -0.5) & (pixels < np.array(shape) - 0.5)).all(axis=1))


def pixels_in_view(points_m: Floats, optics: Optics, shape: tuple[int, int]) -> Floats:
    """Rows and columns (N, 2) of those of some points (K, 3) that are in view."""
    pixels = pixel_of(points_m[points_m[:, 2] > 0], optics, shape)
    return np.asarray(pixels[in_view(pixels, shape)])


def range_over_depth(optics: Optics, shape: tuple[int, int]) -> Floats:
    """Length of each pixel's ray per unit of depth, (H, W)."""
    return np.asarray(np.linalg.norm(pixel_rays(optics, shape), axis=-1))


def squared_distances(shape: tuple[int, ...], anchors: Floats) -> Floats:
    """Squared distance in pixels from each pixel to each anchor (K, 2), (H, W, K)."""
    rows, columns = np.arange(shape[0])[:, None, None], np.arange(shape[1])[:, None]
    return np.asarray((rows - anchors[:, 0]) ** 2 + (columns - anchors[:, 1]) ** 2)


def distances(one: Floats, other: Floats) -> Floats:
    """Distances (K, M) between pixels (K, 2) and others (M, 2)."""
    down, along = (one[:, None, axis] - other[:, axis] for axis in (0, 1))
    return np.asarray(np.sqrt(down**2 + along**2))


def around(image: Floats) -> Floats:
    """Mean of each pixel (H, W) and its eight neighbours; edges are replicated."""
    return _with_next_rows(_with_next_rows(image).T).T / 9


def _with_next_rows(image: Floats) -> Floats:
    total = image.astype(np.float64)
    total[1:] += image[:-1]
    total[:-1] += image[1:]
    total[0] += image[0]
    total[-1] += image[-1]
    return total


def between(image: Floats, positions: Floats) -> Floats:
    """Values (K,) at fractional rows and columns (K, 2), interpolated bilinearly."""
    down, along = (
        hats(position, side) for position, side in zip(positions.T, image.shape, strict=True)
    )
    return np.asarray(((down @ image) * along).sum(axis=1))


def hats(positions: Floats, side: int) -> Floats:
    """Weights (K, side) of the pixels along an axis at fractional positions (K,)."""
    within = np.clip(positions, 0, side - 1)
    return np.maximum(1 - np.abs(within[:, None] - np.arange(side)), 0)


def wide_hats(positions: Floats, side: int) -> Floats:
    """Weights of the mean with both neighbours along the axis, (K, side)."""
    return np.asarray(_with_next_rows(hats(positions, side).T).T / 3)


def point_cloud_ply(points_m: Floats, image: Floats) -> bytes:
    """Binary little-endian PLY file of a point cloud.

    Parameters
    ----------
    points_m
        Points (..., 3) in metres; those that are not finite are left out.
    image
        Brightness (...), written as grey from 0 to the brightest pixel.

    Returns
    -------
    bytes
        Content of the file.
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
