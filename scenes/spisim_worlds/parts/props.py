"""Objects that stand about in scenes, as triangles.

Every object stands on z = 0, centred on the z axis unless stated otherwise, in metres; x points
away from a viewer of its front. Parts may overlap, because only the outer surface is visible.
"""

import numpy as np
from trimesh.creation import cylinder, icosphere, torus
from trimesh.transformations import rotation_matrix

from spisim.scene.families import SceneBuilder
from spisim_worlds.parts import figure
from spisim_worlds.parts.shapes import Mesh, Point, block, lathe, moved, rod, union

WORKER = (figure.resting(-1), figure.resting(1))


def pallet() -> Mesh:
    """EUR pallet, 1.2 m (x) by 0.8 m (y) by 0.144 m."""
    blocks = [
        block((0.145, 0.1, 0.078), (x, y, 0.061))
        for x in (-0.5275, 0, 0.5275)
        for y in (-0.35, 0, 0.35)
    ]
    runners = [block((1.2, 0.1, 0.022), (0, y, 0.011)) for y in (-0.35, 0, 0.35)]
    stringers = [block((0.145, 0.8, 0.022), (x, 0, 0.111)) for x in (-0.5275, 0, 0.5275)]
    boards = [block((1.2, 0.12, 0.022), (0, y, 0.133)) for y in (-0.34, -0.17, 0, 0.17, 0.34)]
    return union(blocks + runners + stringers + boards)


def rack() -> Mesh:
    """Shelf rack, 0.6 m (x) deep, 1.8 m (y) wide, 2.6 m high, decks at 0.15, 1.0 and 1.8 m."""
    corners = [(x, y) for x in (-0.3, 0.3) for y in (-0.9, 0.9)]
    uprights = [block((0.06, 0.08, 2.6), (x, y, 1.3)) for x, y in corners]
    feet = [block((0.12, 0.14, 0.012), (x, y, 0.006)) for x, y in corners]
    beams = [
        block((0.04, 1.8, 0.11), (x, 0, z - 0.055)) for x in (-0.3, 0.3) for z in (0.15, 1.0, 1.8)
    ]
    decks = [block((0.58, 1.74, 0.02), (0, 0, z - 0.01)) for z in (0.15, 1.0, 1.8)]
    braces = [
        rod((-0.3, y, z), (0.3, y, z + 0.6), 0.015, sections=6)
        for y in (-0.9, 0.9)
        for z in (0.2, 1.1, 1.9)
    ]
    return union(uprights + feet + beams + decks + braces)


def open_carton() -> Mesh:
    """Carton of 0.4 m by 0.5 m by 0.3 m without a lid, its four flaps hanging out."""
    length, width, height, wall = 0.4, 0.5, 0.3, 0.006
    walls = [
        block((wall, width, height), (-length / 2, 0, height / 2)),
        block((wall, width, height), (length / 2, 0, height / 2)),
        block((length, wall, height), (0, -width / 2, height / 2)),
        block((length, wall, height), (0, width / 2, height / 2)),
        block((length, width, wall), (0, 0, wall / 2)),
    ]
    flaps = []
    for quarter, (reach, edge) in enumerate([(length, width), (width, length)] * 2):
        flap = block((0.19, edge, wall), (0.095, 0, 0))
        flap.apply_transform(rotation_matrix(np.radians(35), (0, 1, 0)))
        flap.apply_translation((reach / 2, 0, height))
        flap.apply_transform(rotation_matrix(quarter * np.pi / 2, (0, 0, 1)))
        flaps.append(flap)
    return union(walls + flaps)


def drum() -> Mesh:
    """Steel drum of 200 l, 0.58 m across, with two hoops, rims and a recessed lid."""
    hoops = [
        (0.28, 0.27), (0.295, 0.29), (0.295, 0.31), (0.28, 0.33),
        (0.28, 0.55), (0.295, 0.57), (0.295, 0.59), (0.28, 0.61),
    ]  # fmt: skip
    foot = [(0, 0.02), (0.27, 0.02), (0.27, 0), (0.29, 0), (0.29, 0.02), (0.28, 0.03)]
    top = [(0.28, 0.85), (0.29, 0.86), (0.29, 0.88), (0.27, 0.88), (0.27, 0.86), (0, 0.86)]
    bung = moved(cylinder(0.035, 0.03, sections=10), (0.15, 0.1, 0.87))
    return union([lathe(foot + hoops + top, sections=32), bung])


def bucket() -> Mesh:
    """Bucket, 0.3 m across and 0.28 m high, without its handle."""
    outside = [(0, 0), (0.1, 0), (0.14, 0.27), (0.15, 0.27), (0.15, 0.28)]
    inside = [(0.135, 0.28), (0.097, 0.012), (0, 0.012)]
    return lathe(outside + inside, sections=24)


def cone() -> Mesh:
    """Traffic cone, 0.75 m high on a square foot."""
    profile = [(0, 0.03), (0.17, 0.03), (0.16, 0.06), (0.035, 0.74), (0.025, 0.75), (0, 0.75)]
    return union([block((0.42, 0.42, 0.03), (0, 0, 0.015)), lathe(profile, sections=24)])


def gas_cylinder() -> Mesh:
    """Gas bottle of 50 l, 0.23 m across and 1.6 m high, with its cap."""
    shoulder = [
        (0.115 * np.cos(angle), 1.32 + 0.13 * np.sin(angle))
        for angle in np.radians((0, 20, 40, 60, 70))
    ]
    body = [(0, 0), (0.105, 0), (0.115, 0.015), *shoulder, (0.04, 1.46)]
    cap = [(0.045, 1.46), (0.045, 1.56), (0.03, 1.6), (0, 1.6)]
    return lathe(body + cap, sections=20)


def ladder() -> Mesh:
    """Straight ladder, 2.4 m long and 0.42 m (y) wide, eight rungs, upright."""
    rails = [block((0.07, 0.025, 2.4), (0, y, 1.2)) for y in (-0.2, 0.2)]
    rungs = [
        rod((0, -0.2, z), (0, 0.2, z), 0.018, sections=8) for z in np.linspace(0.2, 2.2, 8).tolist()
    ]
    return union(rails + rungs)


def step_ladder() -> Mesh:
    """Two leaves that stand apart along x and meet 1.87 m above the ground, 0.42 m (y) wide."""
    leaves = []
    for way in (-1, 1):
        leaf = ladder().apply_scale((0.7, 1.0, 0.8))
        leaf.apply_transform(rotation_matrix(np.radians(-14 * way), (0, 1, 0)))
        leaves.append(moved(leaf, (0.49 * way, 0, 0.006)))
    return union(leaves)


def pallet_jack() -> Mesh:
    """Hand pallet truck: forks towards +x, handle leaning towards -x."""
    forks = [block((1.15, 0.16, 0.05), (0.575, y, 0.1)) for y in (-0.19, 0.19)]
    rollers = [
        rod((1.0, y - 0.05, 0.04), (1.0, y + 0.05, 0.04), 0.04, sections=10) for y in (-0.19, 0.19)
    ]
    wheels = [
        rod((-0.12, y - 0.03, 0.1), (-0.12, y + 0.03, 0.1), 0.1, sections=14) for y in (-0.07, 0.07)
    ]
    body = [
        block((0.08, 0.54, 0.3), (0.0, 0, 0.27)),
        rod((-0.1, 0, 0.1), (-0.1, 0, 0.5), 0.06, sections=12),
    ]
    handle = [
        rod((-0.1, 0, 0.45), (-0.35, 0, 1.1), 0.02, sections=8),
        rod((-0.35, 0, 1.1), (-0.38, 0.14, 1.2), 0.015, sections=8),
        rod((-0.35, 0, 1.1), (-0.38, -0.14, 1.2), 0.015, sections=8),
        rod((-0.38, -0.14, 1.2), (-0.38, 0.14, 1.2), 0.018, sections=8),
    ]
    return union(forks + rollers + wheels + body + handle)


def worker_clothes() -> Mesh:
    """Overall of a person 1.77 m tall who faces -x, arms a little bent; boots included."""
    return figure.clothes(WORKER)


def worker_skin() -> Mesh:
    """Head, neck and hands that go with the overall."""
    return figure.skin(WORKER)


def worker_hat() -> Mesh:
    """Hard hat that goes with the head."""
    return figure.hard_hat()


def add_worker(
    builder: SceneBuilder,
    at: Point,
    turn: Point,
    clothes: str = "polyester-fabric",
    hat: str = "polypropylene",
) -> None:
    """Add a standing person in a hard hat, with these materials of cloth and hat."""
    builder.mesh("overall", clothes, worker_clothes(), at, turn)
    builder.mesh("skin", "skin", worker_skin(), at, turn)
    builder.mesh("hard hat", hat, worker_hat(), at, turn)


def lamp() -> Mesh:
    """Hanging lamp: shade of 0.4 m with its rim at z = 0, a bulb, and 1.5 m of cable."""
    shade = lathe(
        [(0.2, 0), (0.17, 0.09), (0.09, 0.17), (0.035, 0.2), (0.03, 0.28), (0, 0.28)], sections=24
    )
    lining = lathe([(0, 0.2), (0.03, 0.19), (0.085, 0.16), (0.165, 0.08), (0.2, 0)], sections=24)
    bulb = moved(icosphere(1, 0.05), (0, 0, 0.08))
    return union([shade, lining, bulb, rod((0, 0, 0.25), (0, 0, 1.75), 0.008, sections=6)])


def tyre() -> Mesh:
    """Tyre lying flat, 0.62 m across and 0.2 m high."""
    ring = torus(0.21, 0.1, major_sections=28, minor_sections=12)
    return moved(ring, (0, 0, 0.1))
