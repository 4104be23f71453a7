"""Trees from ten metres on, and woods as seen from afar; lengths in metres."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from spisim.scene.families import SceneBuilder
from spisim_worlds.parts.natural import blob
from spisim_worlds.parts.plants import blades
from spisim_worlds.parts.shapes import Mesh, bars, grid_mesh, lathe, moved, spread, union
from spisim_worlds.parts.terrain import Terrain

#: Trees nearer than this have leaves of natural size, up to this number of trees.
NEAR_M, MAX_NEAR = 14.0, 3
#: Woods farther than this are part of the hills.
FARTHEST_M = 4000.0
#: Kinds of trees to copy.
COPIED = 3
#: Leaves of near and of far trees, and their size.
FINE, COARSE = (6000, 0.13), (800, 0.4)


class Tree(NamedTuple):
    """A tree 1 m high on z = 0, and its foliage."""

    wood: Mesh
    foliage: Mesh
    material: str


def broad_leaved(rng: np.random.Generator, leaves: int, leaf: float, season: str) -> Tree:
    """A trunk with some boughs into a crown of several lumps."""
    wide, low = rng.uniform(0.32, 0.6), rng.uniform(0.15, 0.35)
    trunk = lathe([(0, -0.05), (0.026, -0.05), (0.017, low), (0.006, 0.9), (0, 0.9)], sections=9)
    lumped, boughs = [], []
    lumps = int(rng.integers(4, 9))
    for n in range(lumps):
        size = wide * rng.uniform(0.5, 0.9) * np.array([1, 1, rng.uniform(0.7, 1.1)])
        angle, out = rng.uniform(0, 2 * np.pi), 0.0 if n == 0 else rng.uniform(0.1, 0.3)
        high = low + (1 - low) * (0.65 if n == 0 else rng.uniform(0.3, 0.75))
        centre = np.array([wide * out * np.cos(angle), wide * out * np.sin(angle), high])
        lumped.append(moved(_crown(rng, size, leaf, leaves // lumps), centre))
        boughs.append([(0, 0, low + 0.3 * (high - low)), centre])
    return Tree(union([trunk, bars(boughs, 0.007, 5)]), union(lumped), season)


def conifer(rng: np.random.Generator, leaves: int, leaf: float, _: str) -> Tree:
    """A straight trunk with boughs in whorls that droop, shorter towards the top."""
    wide, low = rng.uniform(0.28, 0.46), rng.uniform(0.05, 0.2)
    trunk = lathe([(0, -0.05), (0.02, -0.05), (0.014, 0.3), (0.003, 1.0), (0, 1.0)], sections=9)
    height = low + (0.98 - low) * np.sort(rng.random(leaves))
    angle = rng.uniform(0, 2 * np.pi, leaves)
    reach = 0.5 * wide * (1 - (height - low) / (1 - low)) ** 0.8
    out = reach * rng.uniform(0.35, 1.0, leaves) ** 0.5
    whorl = 0.25 * np.mod(height, 0.06)
    around = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    positions = out[:, None] * around + np.array([0, 0, 1]) * (height - whorl - 0.35 * out)[:, None]
    foliage = blades(rng, positions, around - (0, 0, 0.5), 2 * leaf)
    return Tree(trunk, foliage, "needles-green")


def poplar(rng: np.random.Generator, leaves: int, leaf: float, season: str) -> Tree:
    """A slender column of leaves nearly down to the ground."""
    wide = rng.uniform(0.14, 0.22)
    crown = moved(_crown(rng, np.array((wide, wide, 0.88)), leaf, leaves), (0, 0, 0.55))
    trunk = lathe([(0, -0.05), (0.018, -0.05), (0.012, 0.3), (0, 0.3)], sections=8)
    return Tree(trunk, crown, season)


def dead(rng: np.random.Generator, *_: object) -> Tree:
    """Bare trunk with stumps of boughs."""
    trunk = lathe([(0, -0.05), (0.022, -0.05), (0.015, 0.4), (0.004, 0.95), (0, 0.95)], sections=9)
    height, angle = rng.uniform(0.25, 0.9, 14), rng.uniform(0, 2 * np.pi, 14)
    reach = rng.uniform(0.05, 0.22, 14) * (1.2 - height)
    foot = np.stack([0 * height, 0 * height, height], axis=1)
    tip = foot + reach[:, None] * np.stack([np.cos(angle), np.sin(angle), 0.4 + 0 * angle], axis=1)
    boughs = np.stack([foot, tip], axis=1)
    return Tree(trunk, bars(boughs, 0.0035, 5), "bark")


def _crown(rng: np.random.Generator, size: Floats, leaf: float, leaves: int) -> Mesh:
    """Return leaves within an ellipsoid, most of them outside; a body inside blocks the view."""
    out = rng.normal(size=(leaves, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    deep = rng.uniform(0.55, 1.05, (leaves, 1))
    return union([blob(rng, 0.5 * size, 0.2, 1), blades(rng, out * deep * size / 2, out, leaf)])


#: Functions that grow a tree, given number, relative size and material of its leaves.
TREES: dict[str, Callable[[np.random.Generator, int, float, str], Tree]] = {
    "broad-leaved": broad_leaved,
    "conifer": conifer,
    "poplar": poplar,
    "dead": dead,
}


def add_wood(
    builder: SceneBuilder,
    name: str,
    kinds: Sequence[str],
    season: str,
    rng: np.random.Generator,
    positions: ArrayLike,
    height_m: float,
) -> None:
    """Add trees of some kinds at positions (n, 3), of about a height.

    Those within `NEAR_M` of the drone have individual leaves of natural size; the others are copies
    with larger leaves.
    """
    at = np.asarray(positions, float).reshape(-1, 3)
    heights = height_m * rng.uniform(0.65, 1.25, len(at))
    turns = rng.uniform(0, 360, len(at))
    order = np.argsort(np.hypot(at[:, 0], at[:, 1]))
    near = order[np.hypot(at[order, 0], at[order, 1]) < NEAR_M][:MAX_NEAR]
    groups = [(group, *FINE) for group in near[:, None]]
    groups += [(order[len(near) :][k::COPIED], *COARSE) for k in range(COPIED)]
    for number, (group, leaves, leaf_m) in enumerate(groups):
        if not len(group):
            continue
        kind = kinds[number % len(kinds)]
        grown = TREES[kind](rng, leaves, leaf_m / height_m, season)
        title = f"{name} {number + 1}"
        builder.mesh(title, "bark", spread(grown.wood, at[group], turns[group], heights[group]))
        foliage = spread(grown.foliage, at[group], turns[group], heights[group])
        builder.mesh(f"leaves of {title}", grown.material, foliage)


def tree_line(
    rng: np.random.Generator, land: Terrain, path: ArrayLike, height_m: float, deep_m: float
) -> Mesh:
    """Add the edge of a wood along points (n, 2), and its tops behind, to the left of the path.

    Crowns protrude by more than their depth, as seen from afar.
    """
    corners = np.asarray(path, float)
    lengths = np.concatenate([[0], np.linalg.norm(np.diff(corners, axis=0), axis=1).cumsum()])
    count = int(np.clip(lengths[-1] / (0.25 * height_m), 8, 400))
    at = np.linspace(0, lengths[-1], count)
    line = np.stack([np.interp(at, lengths, corners[:, axis]) for axis in (0, 1)], axis=1)
    along = np.gradient(line, axis=0)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    crowns = height_m * (0.8 + 0.25 * rng.random(count) - 0.2 * (rng.random(count) < 0.15))
    rows = [(0.0, -0.3), (0.1, 0.45), (0.0, 0.8), (0.25, 1.0), (0.6, 0.85), (1.0, 0.95)]
    points = []
    for out, high in rows:
        off = deep_m * (out + 0.03 * rng.normal(size=count))
        top = crowns * (high + 0.04 * rng.normal(size=count) * (high > 0))
        flat = line + off[:, None] * left
        points.append(np.column_stack([flat, land.height(flat[:, 0], flat[:, 1]) + top]))
    return grid_mesh(np.stack(points))


def add_far_woods(
    builder: SceneBuilder,
    rng: np.random.Generator,
    land: Terrain,
    count: int,
    nearest_m: float,
    heading_deg: float = 0.0,
) -> None:
    """Add strips of wood ahead at random, longer with distance."""
    strips = []
    for distance in nearest_m * (FARTHEST_M / nearest_m) ** rng.uniform(0, 1, count):
        angle = np.radians(heading_deg + rng.uniform(-14, 14))
        middle = distance * np.array([np.cos(angle), np.sin(angle)])
        turn = np.radians(heading_deg + 90 + rng.uniform(-50, 50))
        half = distance * rng.uniform(0.03, 0.3) * np.array([np.cos(turn), np.sin(turn)])
        bend = 0.1 * distance * rng.normal(size=(3, 2)) * 0.2
        path = middle + np.array([1, 0, -1])[:, None] * half + bend
        strips.append(tree_line(rng, land, path, rng.uniform(8, 22), 30 + 0.1 * distance))
    if strips:
        builder.mesh("far woods", "vegetation-canopy", union(strips))


def scattered_tufts(
    rng: np.random.Generator,
    land: Terrain,
    count: int,
    near_m: float,
    far_m: float,
    height_m: float,
) -> Mesh:
    """Add tufts of grass ahead, of constant density in view, with nine blades each."""
    positions = in_view(rng, land, count, near_m, far_m)
    n = np.arange(9)
    lean = rng.uniform(-0.5, 0.5, (count, 9, 2))
    tall = height_m * rng.uniform(0.4, 1.2, (count, 9, 1)) * rng.uniform(0.5, 1.2, (count, 1, 1))
    root = positions[:, None] + np.concatenate(
        [0.35 * height_m * rng.normal(size=(count, 9, 2)), np.full((count, 9, 1), -0.03)], axis=2
    )
    tip = root + tall * np.concatenate([lean, np.ones((count, 9, 1))], axis=2)
    wide = 0.02 * height_m * np.stack([-np.sin(n), np.cos(n), 0.0 * n], axis=1)
    corners = np.stack([root - wide, root + wide, tip], axis=2).reshape(-1, 3)
    return Mesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)


def in_view(
    rng: np.random.Generator,
    land: Terrain,
    count: int,
    near_m: float,
    far_m: float,
    half_deg: float = 14.0,
    heading_deg: float = 0.0,
) -> Floats:
    """Return random positions (n, 3) on the land ahead, within an angle of a heading."""
    distance = near_m * (far_m / near_m) ** rng.random(count)
    angle = np.radians(heading_deg + rng.uniform(-half_deg, half_deg, count))
    return land.positions(distance * np.cos(angle), distance * np.sin(angle))
