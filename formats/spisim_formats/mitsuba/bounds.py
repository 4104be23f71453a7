"""Where Mitsuba's heterogeneous media end: at the box around their grid, whatever their shape."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_formats.library.content import Haze
from spisim_formats.library.lattice import Lattice
from spisim_formats.mitsuba.elements import Node

CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))
#: Of a box, by which it may be off the axes, or another one reach beyond it.
TOLERANCE = 1e-6
EVERYWHERE = np.ones((1, 1, 1), np.float32)


def grid_box(node: Node, density: Lattice | None) -> Floats | None:
    """Low and high corner (2, 3) in the world of what a medium may fill; None for anywhere."""
    if node.type != "heterogeneous":
        return None
    if density is not None:
        to_world = density.to_world
    else:
        given = node.properties.get("sigma_t")
        to_world = given.value("to_world", np.eye(4)) if isinstance(given, Node) else np.eye(4)
    corners = CORNERS @ to_world[:3, :3].T + to_world[:3, 3]
    return np.array([corners.min(axis=0), corners.max(axis=0)])


def clipped(haze: Haze, bounds: Floats) -> Haze | None:
    """What of a medium is within bounds (2, 3); None for nothing.

    A box along the axes becomes a smaller one; of other shapes the density beyond is 0.
    """
    size = bounds[1] - bounds[0]
    if haze.mesh is None:
        points = (CORNERS - 0.5) @ haze.to_world[:3, :3].T + haze.to_world[:3, 3]
    else:
        points = haze.mesh.vertices @ haze.to_world[:3, :3].T + haze.to_world[:3, 3]
    low, high = points.min(axis=0), points.max(axis=0)
    slack = TOLERANCE * np.maximum(size, high - low)
    if (low >= bounds[0] - slack).all() and (high <= bounds[1] + slack).all():
        return haze
    inner = np.maximum(low, bounds[0]), np.minimum(high, bounds[1])
    if not (inner[1] - inner[0] > slack).all():
        return None
    if haze.mesh is None and _is_upright(haze.to_world):
        box = np.diag([*(inner[1] - inner[0]), 1.0])
        box[:3, 3] = (inner[0] + inner[1]) / 2
        return replace(haze, to_world=box, part=None)
    within = np.diag([*size, 1.0])
    within[:3, 3] = bounds[0]
    density = haze.density or Lattice(EVERYWHERE, within)
    return replace(haze, density=replace(density, within=within))


def _is_upright(box: Floats) -> bool:
    across = np.abs(box[:3, :3]) > TOLERANCE * np.abs(box[:3, :3]).max()
    return bool((across.sum(axis=0) == 1).all() and (across.sum(axis=1) == 1).all())
