"""Where spots are in an image."""

import numpy as np

from ..arrays import Floats


def squared_distances(shape: tuple[int, ...], anchors: Floats) -> Floats:
    """Squared distance in pixels from each pixel to each anchor (K, 2), (H, W, K)."""
    rows, columns = np.arange(shape[0])[:, None, None], np.arange(shape[1])[:, None]
    return np.asarray((rows - anchors[:, 0]) ** 2 + (columns - anchors[:, 1]) ** 2)
