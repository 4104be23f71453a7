"""The surroundings of an imported scene: a floor, and environment maps as lamps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.base.config.linear import LINEAR
from spisim.scene.materials import material_table
from spisim_formats.library import shapes
from spisim_formats.library.content import Part, Surface, translation
from spisim_formats.library.materials import Match
from spisim_formats.library.textures import GAMMA, Texture, read_red

#: Margin of the floor beyond the objects on each side.
MARGIN_M = 30.0


def ground(placed: Sequence[trimesh.Trimesh]) -> Part:
    """Return a level rectangle just under meshes (world coordinates), and far beyond them.

    Without a floor, most of a drone's light meets nothing.
    """
    low = np.min([mesh.bounds[0] for mesh in placed], axis=0)
    high = np.max([mesh.bounds[1] for mesh in placed], axis=0)
    size = [float(length) + 2 * MARGIN_M for length in (high - low)[:2]]
    middle = [*(low + high)[:2] / 2, low[2]]
    return Part("ground", shapes.rectangle(size, "ground"), translation(middle), Surface("ground"))


def ground_material(name: str) -> Match:
    """Return a material by name. Raises InputError."""
    if name not in (available := sorted(material_table())):
        raise InputError(f"--ground: unknown material {name!r:.80}: {nearest(name, available)}")
    return Match("(ground)", name, "map", "--ground")


#: Axes of environment maps here (x to the first column, z up) in OpenEXR's, as used by Mitsuba and
#: OpenUSD (y up, the centre at z, columns from -z by -x).
FROM_OPENEXR = np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]])


def read_linear_red(path: Path) -> NDArray[np.float32]:
    """Read linear red (h, w) of an image; 8-bit images have gamma. Raises InputError."""
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
    """Convert an environment map (h, w) in OpenEXR's layout to that of a lamp, with axes (3, 3).

    Its columns run the other way round, and mirrored maps are flipped. Raises InputError unless
    `to_world` (4, 4) is a rotation with a scale.
    """
    picture = red[:, ::-1]
    axes = to_world[:3, :3] @ FROM_OPENEXR
    axes = axes / np.linalg.norm(axes, axis=0)
    if not np.allclose(axes.T @ axes, np.eye(3), atol=1e-3):
        raise InputError(f"{what}: its transform is no rotation")
    if np.linalg.det(axes) < 0:
        picture, axes = picture[:, ::-1], axes * [1, -1, 1]
    return np.ascontiguousarray(picture), axes
