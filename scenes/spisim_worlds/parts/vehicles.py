"""Parked vehicles: they stand on z = 0 along x, front towards +x; lengths in metres."""

from collections.abc import Sequence

import numpy as np

from spisim.scene.families import Point, SceneBuilder
from spisim_worlds.parts.shapes import Mesh, block, lathe, limb, prism, rod, sheet, union

HALF_WIDTH_M = 0.86
WHEELS_X_M = (-1.3, 1.32)


def add_car(builder: SceneBuilder, at: Point, turn: Point) -> None:
    """Hatchback, 4.2 m long, 1.45 m high, its cabin of glass between pillars."""
    body = [
        (-2.05, 0.3), (1.95, 0.3), (2.1, 0.42), (2.1, 0.62), (1.9, 0.76),
        (1.0, 0.92), (-1.9, 0.95), (-2.1, 0.85), (-2.12, 0.5),
    ]  # fmt: skip
    # Corners of the glass: windscreen foot and head, rear window head and foot.
    cabin = [(1.0, 0.92), (0.25, 1.4), (-1.45, 1.42), (-1.95, 0.94)]
    roof = prism([(0.28, 1.38), (0.0, 1.46), (-1.2, 1.47), (-1.48, 1.4)], 1.3)
    seats = [
        limb((x, y, 0.75), (x - 0.12, y, 1.15), 0.14) for x in (-0.2, -1.0) for y in (-0.35, 0.35)
    ]
    mirrors = [block((0.08, 0.16, 0.12), (0.55, side * 0.95, 0.98)) for side in (-1, 1)]
    shell = union([prism(body, 2 * HALF_WIDTH_M), roof, *mirrors])
    builder.mesh("car body", "steel-painted", shell, at, turn)
    _add_cabin(builder, "car", cabin, 0.62, at, turn)
    builder.mesh("car seats", "polyester-fabric", union(seats), at, turn)
    _add_wheels(builder, "car", at, turn)


def add_van(builder: SceneBuilder, at: Point, turn: Point) -> None:
    """Panel van, 4.6 m long, 2.05 m high, glass in front only."""
    body = [
        (-2.3, 0.32), (2.1, 0.32), (2.28, 0.45), (2.28, 0.8), (2.15, 1.0),
        (1.6, 1.12), (0.7, 1.12), (-2.3, 1.12),
    ]  # fmt: skip
    box = [(-2.3, 1.1), (0.7, 1.1), (0.7, 2.0), (0.5, 2.05), (-2.2, 2.05), (-2.3, 1.98)]
    cabin = [(1.6, 1.1), (0.95, 1.95), (0.7, 1.98), (0.7, 1.1)]
    rails = [
        rod((-1.9, side * 0.7, 2.12), (0.2, side * 0.7, 2.12), 0.015, sections=6)
        for side in (-1, 1)
    ]
    feet = [block((0.05, 0.05, 0.12), (x, y, 2.07)) for x in (-1.8, 0.1) for y in (-0.7, 0.7)]
    whole = [prism(body, 2 * HALF_WIDTH_M), prism(box, 1.64), *rails, *feet]
    builder.mesh("van body", "paint-white", union(whole), at, turn)
    _add_cabin(builder, "van", cabin, 0.74, at, turn)
    seats = [limb((0.95, y, 1.0), (0.85, y, 1.5), 0.16) for y in (-0.4, 0.4)]
    builder.mesh("van seats", "polyester-fabric", union(seats), at, turn)
    _add_wheels(builder, "van", at, turn)


def add_tractor(builder: SceneBuilder, at: Point, turn: Point) -> None:
    """Farm tractor, 3.6 m long, 2.8 m high: large wheels behind, a cab with panes, an exhaust."""
    tyres = [rod((-0.9, s * 0.75, 0.8), (-0.9, s * 1.2, 0.8), 0.8, 24) for s in (-1, 1)]
    tyres += [rod((1.2, s * 0.75, 0.5), (1.2, s * 1.1, 0.5), 0.5, 20) for s in (-1, 1)]
    hubs = [rod((-0.9, s * 1.1, 0.8), (-0.9, s * 1.22, 0.8), 0.4, 18) for s in (-1, 1)]
    body = [block((2.0, 0.8, 0.8), (0.8, 0, 1.15)), block((1.0, 1.2, 0.5), (-0.8, 0, 1.1))]
    body.append(block((1.5, 1.5, 0.1), (-0.7, 0, 2.75)))
    body.append(rod((0.9, 0.35, 1.5), (0.9, 0.35, 2.5), 0.05, 10))
    corners = [(x, y) for x in (-1.4, 0.0) for y in (-0.65, 0.65)]
    body += [block((0.07, 0.07, 1.5), (x, y, 2.0)) for x, y in corners]
    body += [block((1.3, 0.5, 0.06), (-0.9, s * 0.95, 1.68)) for s in (-1, 1)]
    panes = [block((0.02, 1.2, 1.3), (x, 0, 2.0)) for x in (-1.4, 0.0)]
    panes += [block((1.3, 0.02, 1.3), (-0.7, y, 2.0)) for y in (-0.65, 0.65)]
    builder.mesh("tractor tyres", "rubber-black", union(tyres), at, turn)
    builder.mesh("tractor wheel hubs", "steel-painted", union(hubs), at, turn)
    builder.mesh("tractor", "paint-gloss-green", union(body), at, turn)
    builder.mesh("tractor windows", "glass-pane", union(panes), at, turn)


def _add_cabin(
    builder: SceneBuilder,
    name: str,
    outline: Sequence[Point],
    half_top: float,
    at: Point,
    turn: Point,
) -> None:
    """Add panes between four corners of a side view (x, z), and pillars along them."""
    half = np.where(np.array(outline)[:, 1] > 1.2, half_top, HALF_WIDTH_M - 0.03)
    left = np.array([(x, w, z) for (x, z), w in zip(outline, half, strict=True)])
    right = left * (1, -1, 1)
    front = sheet([left[0], right[0], right[1], left[1]])
    rear = sheet([left[2], right[2], right[3], left[3]])
    panes = union([sheet(left), sheet(right), front, rear])
    builder.mesh(f"{name} windows", "glass-pane", panes, at, turn)
    edges = [(0, 1), (1, 2), (2, 3)]
    pillars = [rod(side[a], side[b], 0.03, sections=6) for side in (left, right) for a, b in edges]
    pillars += [rod(left[k], right[k], 0.03, sections=6) for k in (1, 2)]
    builder.mesh(f"{name} pillars", "steel-painted", union(pillars), at, turn)


def _add_wheels(builder: SceneBuilder, name: str, at: Point, turn: Point) -> None:
    tyres, hubs = [], []
    for x in WHEELS_X_M:
        for side in (-1, 1):
            tyres.append(_disc(x, side, 0.31, 0.2, 0.91))
            hubs.append(_disc(x, side, 0.19, 0.05, 0.925))
    builder.mesh(f"{name} tyres", "rubber-black", union(tyres), at, turn)
    builder.mesh(f"{name} wheel rims", "aluminium-rough", union(hubs), at, turn)


def _disc(x: float, side: int, radius: float, width: float, outer: float) -> Mesh:
    """Wheel-like disc whose outer face is at y = ±`outer`."""
    rim = 0.15 * radius
    disc = lathe(
        [(0, 0), (radius - rim, 0), (radius, rim), (radius, width), (0, width)], sections=24
    )
    disc.apply_transform(
        np.array([[1, 0, 0, x], [0, 0, -side, side * outer], [0, side, 0, 0.31], [0, 0, 0, 1.0]])
    )
    return disc
