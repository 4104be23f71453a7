"""Pictures of all around, as lamps of scene files have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config.linear import LINEAR
from spisim_formats.library.textures import GAMMA, Texture, read_red

#: Axes of a picture of all around here, x to where its columns begin and z up, in OpenEXR's: y up,
#: the middle at z, columns from -z by -x, as Mitsuba and OpenUSD have them.
FROM_OPENEXR = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])


def read_linear_red(path: Path) -> NDArray[np.float32]:
    """Linear red (h, w) of a picture; one of 8 bits has gamma. InputError for what is unfit."""
    if reader := LINEAR.get(path.suffix.lower()):
        red = reader(path)
    else:
        stored, _ = read_red(Texture(path.name, path))
        red = (stored ** (1 / GAMMA)).astype(np.float32)
    if min(red.shape) < 2 or red.min() < 0 or not red.any():
        raise InputError(f"{path.name}: should hold values from 0 on, and not only 0")
    return red


def surround(
    red: NDArray[np.float32], to_world: Floats, what: str
) -> tuple[NDArray[np.float32], Floats]:
    """A picture (h, w) of OpenEXR's layout as a lamp has it, and its axes (3, 3).

    Its columns go the other way round. Mirrored ones are turned in the picture. InputError unless
    `to_world` (4, 4) turns it, whatever its scale.
    """
    picture = red[:, ::-1]
    axes = to_world[:3, :3] @ FROM_OPENEXR
    axes = axes / np.linalg.norm(axes, axis=0)
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3):
        raise InputError(f"{what}: its transform is no rotation")
    if np.linalg.det(axes) < 0:
        picture, axes = picture[:, ::-1], axes * [1, -1, 1]
    return np.ascontiguousarray(picture), axes
