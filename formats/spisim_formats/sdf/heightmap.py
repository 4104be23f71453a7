"""Gazebo's heightmaps: a grey picture of heights as a mesh.

https://gazebosim.org/api/sim/8/, "Heightmaps": black is the lowest, white the size's z above it.
The picture lies as a map does, its top to the north (+y).
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh

from reconstruction.base.errors import InputError
from spisim.base.config.files import grey_picture

#: Vertices along each edge; finer pictures are thinned.
MAX_VERTICES = 1025


def heightmap(path: Path, size: Sequence[float]) -> trimesh.Trimesh:
    """Surface over a rectangle about the origin, `size` metres in x, y, z, from a PNG file.

    Raises InputError for a size that is not positive, and for what is no picture.
    """
    if not min(size[:2]) > 0 or not size[2] != 0:
        raise InputError(f"size should be positive; found {', '.join(map(str, size))}")
    heights = grey_picture(path)
    if min(heights.shape) < 2:
        raise InputError(f"{path.name!r} has one row or column of heights")
    rows, columns = (
        np.unique(np.linspace(0, count - 1, min(count, MAX_VERTICES)).round().astype(int))
        for count in heights.shape
    )
    x = (columns / (heights.shape[1] - 1) - 0.5) * size[0]
    y = (0.5 - rows / (heights.shape[0] - 1)) * size[1]
    points = np.stack([*np.meshgrid(x, y), heights[np.ix_(rows, columns)] * size[2]], axis=-1)
    number = np.arange(len(rows) * len(columns)).reshape(len(rows), len(columns))
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    faces = np.concatenate([np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)])
    return trimesh.Trimesh(points.reshape(-1, 3), faces.reshape(-1, 3), process=False)
