"""Stairs other than two flights about a landing: winding in a shaft, or straight.

Each adds itself to a builder and returns the azimuth and the target of the drone; lengths in
metres.
"""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import SceneBuilder
from spisim_worlds.parts.shapes import (
    Mesh,
    bars,
    block,
    grid_mesh,
    lathe,
    rod,
    sheet,
    spread,
    tube,
    union,
)  # fmt: skip

SLAB_M, RAILING_M = 0.16, 0.95
#: Fixtures on walls.
PLATES = ("steel-painted", "paint-white", "rubber-black", "wood-dry", "glass-painted-back")


def add_winding(
    builder: SceneBuilder, rng: np.random.Generator, rise: float, stairs: str, walls: str
) -> tuple[Floats, Floats]:
    """Steps around a newel or an open well, in a round or a square shaft; eye and aim."""
    well = rng.choice([0.12, rng.uniform(0.35, 0.9)])
    outer = well + rng.uniform(1.0, 1.7)
    per_turn = int(np.ceil(2.9 / rise)) + int(rng.integers(0, 5))
    count = int(per_turn * rng.uniform(2.2, 3.2))
    way = rng.choice([-1, 1])
    angle = way * 2 * np.pi / per_turn
    steps = [
        _wedge(well, outer, k * angle, angle, (k + 1) * rise, 1.6 * rise) for k in range(count)
    ]
    builder.mesh("steps", stairs, union(steps))
    top = count * rise + 2.4
    if well < 0.2:
        builder.mesh("newel", stairs, rod((0, 0, -0.1), (0, 0, top), well + 0.02, 18))
    round_ = rng.random() < 0.5
    sides = 32 if round_ else 4
    reach = outer + 0.02 if round_ else (outer + 0.05) * np.sqrt(2)
    turn = np.linspace(0, 2 * np.pi, sides + 1) + (0 if round_ else np.pi / 4)
    ring = reach * np.column_stack([np.cos(turn), np.sin(turn)])
    lines = [np.column_stack([ring, np.full(len(ring), z)]) for z in (-0.1, top)]
    builder.mesh("shaft", walls, grid_mesh(np.stack(lines)))
    ends = [lathe([(0, z), (1.5 * outer, z), (1.5 * outer, z + 0.1), (0, z + 0.1)], 24)
            for z in (-0.1, top)]  # fmt: skip
    builder.mesh("floor and ceiling", walls, union(ends))
    _winding_rails(builder, rng, well, outer, rise, angle, count)
    at = float(rng.uniform(0.25, 0.6)) * count
    azimuth, radius = at * angle, well + rng.uniform(0.4, 0.6) * (outer - well)
    eye = np.array(
        [radius * np.cos(azimuth), radius * np.sin(azimuth), at * rise + rng.uniform(1.2, 1.6)]
    )
    along = way * np.array([-np.sin(azimuth), np.cos(azimuth), 0]) * rng.choice([-1, 1])
    inward = -np.array([np.cos(azimuth), np.sin(azimuth), 0])
    mix = rng.uniform(-0.3, 1.0)
    aim = eye + along + mix * inward + np.array([0, 0, rng.uniform(-0.75, 0.6)])
    return eye, aim


def _plates(
    builder: SceneBuilder, rng: np.random.Generator, positions: Floats, turns_deg: Floats, name: str
) -> None:
    """Add signs, boxes, grilles and patches on walls at positions (n, 3), facing their own -x."""
    for number, material in enumerate(PLATES):
        own = slice(number, None, len(PLATES))
        if not len(positions[own]):
            continue
        size = rng.uniform((0.03, 0.12, 0.12), (0.12, 0.7, 0.8))
        parts = [block(size, (0, 0, 0))]
        if rng.random() < 0.5:
            across = np.arange(-0.4, 0.41, 0.2) * size[2]
            parts += [block((size[0] + 0.03, size[1], 0.06 * size[2]), (0, 0, z)) for z in across]
        mesh = spread(
            union(parts), positions[own], turns_deg[own], rng.uniform(0.6, 1.4, len(positions[own]))
        )
        builder.mesh(f"{name} {number + 1}", material, mesh)


def _winding_rails(
    builder: SceneBuilder, rng: np.random.Generator, well: float, outer: float, rise: float,
    angle: float, count: int,
) -> None:  # fmt: skip
    """A rail on the wall, and balusters with a rail around an open well; lamps on the wall."""
    k = np.arange(count)
    turn, z = (k + 0.5) * angle, (k + 1) * rise

    def helix(radius: float, high: float) -> Floats:
        return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z + high])

    builder.mesh("rail on the wall", "wood-dry", tube(helix(outer - 0.08, RAILING_M), 0.022, 7))
    if well > 0.2:
        feet = helix(well + 0.05, 0.0)
        uprights = np.stack([feet, feet + np.array([0, 0, RAILING_M])], axis=1)
        builder.mesh("balusters", "steel-painted", bars(uprights, rng.uniform(0.005, 0.012), 6))
        builder.mesh("handrail", "wood-dry", tube(helix(well + 0.05, RAILING_M), 0.024, 8))
    lamp = lathe([(0, -0.12), (0.08, -0.08), (0.1, 0), (0, 0.04)], 14)
    picked = helix(outer - 0.12, 2.0)[:: int(rng.integers(5, 12))]
    builder.mesh("lamps", "paint-white", spread(lamp, picked, 0, 1))
    on_wall = rng.integers(0, count, 36)
    spots = helix(outer, 0.0)[on_wall] + rng.uniform((0, 0, 0.3), (0, 0, 2.2), (36, 3))
    _plates(builder, rng, spots, np.degrees(turn[on_wall]), "plates")
    where = rng.uniform(0, 2 * np.pi, 5)
    foot = outer * np.stack([np.cos(where), np.sin(where)], axis=1)
    low, high = (np.column_stack([foot, np.full(5, level)]) for level in (0.0, z[-1] + 2))
    pipes = np.stack([low, high], axis=1)
    builder.mesh("pipes", "steel-galvanised", bars(pipes, rng.uniform(0.015, 0.06), 10))


def _wedge(inner: float, outer: float, start: float, angle: float, top: float, deep: float) -> Mesh:
    """Return one step between two radii, `deep` thick, slightly longer than its turn."""
    turn = np.linspace(start, start + 1.12 * angle, 4)
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    outline = np.vstack([inner * ring, outer * ring[::-1]])
    if angle < 0:
        outline = outline[::-1]
    outline = outline[::-1]
    n = len(outline)
    vertices = np.vstack([np.column_stack([outline, np.full(n, z)]) for z in (top - deep, top)])
    quads = np.arange(n // 2 - 1)
    cap = np.concatenate([np.stack([quads, quads + 1, n - 1 - quads], -1),
                          np.stack([quads + 1, n - 2 - quads, n - 1 - quads], -1)])  # fmt: skip
    k, following = np.arange(n), (np.arange(n) + 1) % n
    skirt = np.vstack(
        [np.stack([k, following, following + n], -1), np.stack([k, following + n, k + n], -1)]
    )
    return Mesh(vertices, np.vstack([cap[:, ::-1], cap + n, skirt]), process=False)


def add_straight(
    builder: SceneBuilder, rng: np.random.Generator, rise: float, tread: float, width: float,
    stairs: str, walls: str,
) -> tuple[Floats, Floats]:  # fmt: skip
    """One long flight with resting places, between walls or in the open; eye and aim."""
    runs, n = int(rng.integers(1, 4)), int(rng.integers(6, 14))
    half = width * rng.uniform(0.6, 1.6)
    x, z = 3.0, 0.0
    parts = [block((x + 4, 2 * half, 0.2), ((x - 4) / 2, 0, -0.1))]
    rails = []
    for _ in range(runs):
        start = np.array([x, 0, z])
        for _ in range(n):
            z += rise
            parts.append(
                block(
                    (tread + 0.02, 2 * half, rise + SLAB_M),
                    (x + tread / 2, 0, z - (rise + SLAB_M) / 2),
                )
            )
            x += tread
        rails.append(np.stack([start, np.array([x, 0, z])]))
        rest = rng.uniform(1.0, 2.5)
        parts.append(block((rest, 2 * half, SLAB_M), (x + rest / 2, 0, z - SLAB_M / 2)))
        x += rest
    builder.mesh("steps", stairs, union(parts))
    _straight_rails(builder, rng, rails, half)
    end, top = x + rng.uniform(0.5, 3.0), z + 2.6
    parts = [block((0.2, 2 * half + 0.4, top + 2.0), (end, 0, top / 2))]
    builder.mesh("end wall", walls, union(parts))
    builder.box(
        "door", "wood-dry", (0.08, 0.9, 2.05), (end - 0.12, rng.uniform(-0.3, 0.3) * half, z + 1.02)
    )
    sides = [
        block((end + 4.0, 0.15, top + 2.0), (end / 2 - 2.0, s * (half + 0.07), top / 2))
        for s in (-1, 1)
    ]
    if rng.random() < 0.7:
        builder.mesh("side walls", walls, union(sides))
        slope = [(-4, -half, 2.7), (-4, half, 2.7), (end, half, top), (end, -half, top)]
        builder.mesh("ceiling", "plasterboard", sheet(slope))
    else:
        builder.mesh(
            "cheek walls", walls, union([side.apply_translation((0, 0, -2.4)) for side in sides])
        )
    n = 40
    side = rng.choice([-1.0, 1.0], n)
    x_on = rng.uniform(-2, end, n)
    level = np.interp(x_on, [3.0, x], [0.0, z]) + rng.uniform(0.2, 2.2, n)
    _plates(builder, rng, np.stack([x_on, side * half, level], axis=1), 90.0 * side, "plates")
    builder.box("wall below", walls, (0.2, 2 * half + 6, 30), (-3.9, 0, 4))
    up = rng.random() < 0.5
    y = rng.uniform(-0.6, 0.6) * half
    if up:
        eye = np.array([rng.uniform(-0.5, 2.0), y, rng.uniform(1.0, 1.9)])
        aim = np.array([x, rng.uniform(-0.8, 0.8) * half, rng.uniform(0.3, 1.0) * z + 0.5])
    else:
        eye = np.array([x - 0.4, y, z + rng.uniform(1.0, 1.8)])
        aim = np.array([2.0, rng.uniform(-0.8, 0.8) * half, rng.uniform(-0.2, 0.6) * z])
    return eye, aim


def _straight_rails(
    builder: SceneBuilder, rng: np.random.Generator, runs: list[Floats], half: float
) -> None:
    """Handrails on posts at both sides, or in the middle of wide stairs."""
    positions = [0.0] if half > 1.3 and rng.random() < 0.6 else [-half + 0.1, half - 0.1]
    posts, rails = [], []
    for low, high in runs:
        for y in positions:
            off = np.array([0, y, 0])
            rails.append([low + off + (0, 0, RAILING_M), high + off + (0, 0, RAILING_M)])
            for t in np.linspace(0, 1, int(rng.integers(4, 20))):
                foot = low + t * (high - low) + off
                posts.append([foot, foot + np.array([0, 0, RAILING_M])])
    builder.mesh("balusters", "steel-painted", bars(posts, rng.uniform(0.006, 0.016), 6))
    builder.mesh("handrail", "steel-galvanised", bars(rails, 0.022, 8))
