"""Where virtual pixels look, the projector's pinhole model, and where spots are among them."""

import numpy as np

from ..base.arrays import Floats
from ..capture import Optics


def pixel_rays(optics: Optics, shape: tuple[int, int]) -> Floats:
    """Directions through the pixel centres, (H, W, 3), scaled to z = 1.

    A depth times this is a point; its length is range over depth.
    """
    height, width = shape
    x = (2 * np.arange(width) + 1 - width) / width * optics.tan_half_width
    y = (2 * np.arange(height) + 1 - height) / height * optics.tan_half_height
    rays = np.ones((height, width, 3))
    rays[..., 0], rays[..., 1] = x, y[:, None]
    return rays


def pixel_of(directions: Floats, optics: Optics, shape: tuple[int, int]) -> Floats:
    """Row and column (K, 2), fractional with pixel centres at integers, of directions (K, 3)."""
    height, width = shape
    row = directions[:, 1] / directions[:, 2] / optics.tan_half_height
    column = directions[:, 0] / directions[:, 2] / optics.tan_half_width
    return np.stack([(row + 1) * height / 2 - 0.5, (column + 1) * width / 2 - 0.5], axis=1)


def range_over_depth(optics: Optics, shape: tuple[int, int]) -> Floats:
    """Length of each pixel's ray per unit of depth, (H, W)."""
    return np.asarray(np.linalg.norm(pixel_rays(optics, shape), axis=-1))


def squared_distances(shape: tuple[int, ...], anchors: Floats) -> Floats:
    """Squared distance in pixels from each pixel to each anchor (K, 2), (H, W, K)."""
    rows, columns = np.arange(shape[0])[:, None, None], np.arange(shape[1])[:, None]
    return np.asarray((rows - anchors[:, 0]) ** 2 + (columns - anchors[:, 1]) ** 2)
