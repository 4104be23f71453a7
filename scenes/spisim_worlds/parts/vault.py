"""Vaults of tunnels along x: outline, lining with niches, ribs. The floor is at z = 0."""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.shapes import Mesh, grid_mesh, sheet, union

NICHE_LENGTH_M, NICHE_HEIGHT_M = 1.2, 1.9


def outline_of(profile: str, radius: float) -> Floats:
    """Return points (n, 2), (y, z), of a vault from the floor on the left over the top.

    The profile is round, horseshoe, box or oval. A round tunnel is cut by its floor 0.6 radii below
    its middle; a horseshoe has upright walls.
    """
    if profile == "horseshoe":
        arc = np.linspace(0, np.pi, 19)
        vault = radius * np.column_stack([np.cos(arc), np.sin(arc)]) + (0, 0.55 * radius)
        return np.vstack([[radius, 0], vault, [-radius, 0]])
    if profile == "box":
        high = max(1.25 * radius, 2.4)
        wall = [(1.0, z) for z in np.linspace(0, 0.85, 13)]
        half = np.array([*wall, (0.85, 1), (0.4, 1), (0, 1)]) * (radius, high)
        return np.vstack([half, half[-2::-1] * (-1, 1)])
    if profile == "oval":
        arc, flat = np.linspace(-0.35, np.pi + 0.35, 41), max(0.75, 1.8 / radius)
        outline = np.column_stack([np.cos(arc), flat * (np.sin(arc) + np.sin(0.35))])
        return np.asarray(radius * outline)
    low = np.arcsin(0.6)
    arc = np.linspace(-low, np.pi + low, 25)
    return np.asarray(radius * np.column_stack([np.cos(arc), np.sin(arc)]) + (0, 0.6 * radius))


def half_profile(outline: Floats) -> tuple[Floats, Floats]:
    """Return distances from the middle, ascending, and the height of the vault there."""
    left = outline[: int(outline[:, 1].argmax()) + 1]
    upper = left[left[:, 1] >= left[int(left[:, 0].argmax()), 1]][::-1]
    return upper[:, 0], upper[:, 1]


def left_wall(outline: Floats, height: float) -> float:
    """Return y of the left wall at a height."""
    left = outline[: len(outline) // 2 + 1]
    return float(np.interp(height, left[:, 1], left[:, 0]))


def lining(outline: Floats, start: float, end: float, niches: list[float]) -> Mesh:
    """Sheet along the outline, open where niches are, and the niches themselves."""
    k = int(np.argmax(outline[:, 1] > NICHE_HEIGHT_M)) - 1
    edges = [start, *(x + d for x in niches for d in (0.0, NICHE_LENGTH_M)), end]
    parts = [_stretch(outline[k:], start, end)]
    parts += [
        _stretch(outline[: k + 1], a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)
    ]
    for x in niches:
        parts.append(_niche(outline[: k + 1], x, x + NICHE_LENGTH_M))
    return union(parts)


def _stretch(outline: Floats, start: float, end: float) -> Mesh:
    lines = [np.column_stack([np.full(len(outline), x), outline]) for x in (start, end)]
    return grid_mesh(np.stack(lines))


def _niche(edge: Floats, start: float, end: float) -> Mesh:
    """Walls, floor and head of a recess, 0.6 m deep, whose opening runs up along (y, z)."""
    deep = edge[:, 0].max() + 0.6
    (foot_y, bottom), (head_y, top) = edge[0], edge[-1]
    floor = [
        (start, foot_y, bottom),
        (end, foot_y, bottom),
        (end, deep, bottom),
        (start, deep, bottom),
    ]
    back = [(start, deep, bottom), (end, deep, bottom), (end, deep, top), (start, deep, top)]
    head = [(start, head_y, top), (end, head_y, top), (end, deep, top), (start, deep, top)]
    sides = []
    for x in (start, end):
        front = np.column_stack([np.full(len(edge), x), edge])
        behind = np.column_stack([front[:, 0], np.full(len(edge), deep), edge[:, 1]])
        sides.append(grid_mesh(np.stack([front, behind])))
    return union([sheet(floor), sheet(back), sheet(head), *sides])


def ribs(outline: Floats, along: Floats) -> Mesh:
    """Bands across the vault at these x, the joints of the lining."""
    centre = np.array([0.0, outline[:, 1].mean()])
    inner = centre + (outline - centre) * 0.975
    parts = []
    for x in along:
        lines = [
            np.column_stack([np.full(len(line), position), line])
            for position, line in ((x, outline), (x, inner), (x + 0.15, inner), (x + 0.15, outline))
        ]
        parts.append(grid_mesh(np.stack(lines)))
    return union(parts)
