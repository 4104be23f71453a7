"""A floor for what was modelled alone: without one, most of a drone's light meets nothing."""

from collections.abc import Sequence

import numpy as np
import trimesh

from reconstruction.base.errors import InputError, nearest
from spisim.scene.materials import material_table
from spisim_formats.library import shapes
from spisim_formats.library.content import Part, Surface, translation
from spisim_formats.library.materials import Match

#: Beyond the objects on each side.
MARGIN_M = 30.0


def ground(placed: Sequence[trimesh.Trimesh]) -> Part:
    """A level rectangle right under meshes (world coordinates), and far beyond them."""
    low = np.min([mesh.bounds[0] for mesh in placed], axis=0)
    high = np.max([mesh.bounds[1] for mesh in placed], axis=0)
    size = [float(length) + 2 * MARGIN_M for length in (high - low)[:2]]
    middle = [*(low + high)[:2] / 2, low[2]]
    return Part("ground", shapes.rectangle(size, "ground"), translation(middle), Surface("ground"))


def ground_material(name: str) -> Match:
    """A material by its name; InputError for one that there is not."""
    if name not in (available := sorted(material_table())):
        raise InputError(f"--ground: unknown material {name!r:.80}: {nearest(name, available)}")
    return Match("(ground)", name, "map", "--ground")
