"""A shipyard: a hull on the quay, masts and stays, cranes, containers, water and sky."""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.boats import add_boat, hull
from spisim_worlds.parts.cranes import CRANES
from spisim_worlds.parts.lattice import boom
from spisim_worlds.parts.props import add_worker, cone, drum, gas_cylinder, pallet
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import (
    Mesh,
    bars,
    block,
    lathe,
    moved,
    rod,
    spread,
    tube,
    union,
)  # fmt: skip
from spisim_worlds.parts.terrain import Terrain, add_shore, hills, patchwork, terrain, waves
from spisim_worlds.parts.woods import add_far_woods

#: The quay's edge is y = 0, the water behind it; level of the water, and how far the yard goes.
WATER_M, YARD_M = -2.2, 60.0


class ShipyardParameters(Parameters):
    """The drone inspects one thing and sees the others, the water and the sky behind it."""

    subject: str = one_of(
        "mast", "hull", "crane", "containers", "superstructure", "quay", text="looked at"
    )
    distance_m: float = drawn_log(2.0, 14.0, "to the place on it that is looked at")
    azimuth_deg: float = drawn(-75.0, 75.0, "from which it is seen, from square to the quay")
    above_m: float = drawn(-3.5, 3.5, "how much higher the drone is than that place")
    pitch_deg: float = drawn(-9.0, 7.0, "of the line of sight from that place, down is positive")
    aside_deg: float = drawn(-8.0, 8.0, "of the line of sight from that place, to the left")
    ship_m: float = drawn_log(18.0, 110.0, "length of the ship")
    freeboard_m: float = drawn(1.5, 8.0, "height of its side at midships above the quay")
    ship: str = one_of("afloat", "docked", text="beside the quay, or on blocks on it")
    paint: str = one_of(
        "steel-painted", "steel-rusty", "paint-black", "paint-white", text="of the hull"
    )
    mast_m: float = drawn(5.0, 22.0, "height of the mast above the deck")
    stays: int = drawn(2, 7, "on each side of the mast")
    crane: str = one_of("tower", "portal", "jib", "none", text="on the quay")
    crane_m: float = drawn(9.0, 30.0, "height of the crane")
    storeys: int = drawn(1, 4, "of containers")
    scaffold: str = one_of("none", "tubes", text="along the hull")
    clutter: int = drawn(2, 14, "things on the quay")
    hills_m: float = drawn(0.0, 300.0, "height of the far shore")


def build(parameters: ShipyardParameters, rng: np.random.Generator) -> SceneBuilder:
    """The quay is z = 0 and runs along x; the ship lies along it, its near side towards -y."""
    builder = SceneBuilder((0, 0, 0), (1, 0, 0), **outdoors(rng))
    positions = {
        **_ship(builder, parameters, rng),
        **CRANES[parameters.crane](builder, rng, parameters.crane_m, YARD_M),
        "containers": _containers(builder, parameters, rng),
        "quay": np.array([rng.uniform(-8, 8), rng.uniform(-6, 0), rng.uniform(0, 1.2)]),
    }
    _look(builder, parameters, positions.get(parameters.subject, positions["mast"]))
    _quay(builder, parameters, rng)
    heading = np.subtract(builder.look_at_m, builder.position_m)
    land = _water(builder, parameters, rng)
    heading_deg = float(np.degrees(np.arctan2(heading[1], heading[0])))
    far = int(rng.integers(2, 8)) if heading_deg > 0 else 0
    add_far_woods(builder, rng, land, far, 900.0, heading_deg)
    for number in range(int(rng.integers(0, 4))):
        away, angle = rng.uniform(15, 150), np.radians(heading_deg + rng.uniform(-10, 10))
        x, y = (np.array([np.cos(angle), np.sin(angle)]) * away + builder.position_m[:2]).tolist()
        if y > 35:
            add_boat(builder, rng, f"boat {number + 1}", (x, y, WATER_M), rng.uniform(0, 360))
    return builder


def _look(builder: SceneBuilder, parameters: ShipyardParameters, position: Floats) -> None:
    """Move the drone to look at a point, without entering the quay."""
    angle = np.radians(parameters.azimuth_deg - 90)
    level = np.sqrt(max(1.0, parameters.distance_m**2 - parameters.above_m**2))
    away = np.array([level * np.cos(angle), level * np.sin(angle), parameters.above_m])
    eye = position + away
    eye[2] = max(eye[2], 1.2)
    view = position - eye
    turn = np.arctan2(view[1], view[0]) + np.radians(parameters.aside_deg)
    pitch = np.arctan2(-view[2], np.hypot(*view[:2])) + np.radians(parameters.pitch_deg)
    pitch = np.clip(pitch, -0.45, 0.5)
    ahead = np.array([np.cos(turn) * np.cos(pitch), np.sin(turn) * np.cos(pitch), -np.sin(pitch)])
    builder.position_m, builder.look_at_m = tuple(eye), tuple(eye + 10 * ahead)


def _ship(
    builder: SceneBuilder, parameters: ShipyardParameters, rng: np.random.Generator
) -> dict[str, Floats]:
    """Add hull, plates, railing, superstructure and mast; return points to look at."""
    length = parameters.ship_m
    beam = 0.16 * length + 2.5
    docked = parameters.ship == "docked"
    free = parameters.freeboard_m
    draught = 0.6 * free
    # Afloat the water line is z = WATER_M; docked the keel is on blocks.
    base = draught + 0.8 if docked else WATER_M
    side = -0.5 * YARD_M * 0.25 if docked else beam / 2 + 0.8
    y, deck = side + (beam / 2 - 2.0 if docked else 0.0), base + free - (0 if docked else WATER_M)
    high = deck - base
    yaw = 0.0 if rng.random() < 0.5 else 180.0
    at, turn = (rng.uniform(-0.3, 0.3) * length, y, base), (0.0, 0.0, yaw)
    builder.mesh("hull", parameters.paint, hull(length, beam, high, draught), at, turn)
    x0, near = at[0], y - beam / 2
    if docked:
        blocks = [
            block((1.0, 1.6, 0.9), (x0 + k * 3.0, y, 0.4))
            for k in range(-int(length / 8), int(length / 8))
        ]
        builder.mesh("keel blocks", "wood-weathered", union(blocks))
    xs = np.arange(x0 - 0.4 * length, x0 + 0.25 * length, rng.uniform(1.2, 3.0))
    ring = [rod((x, near - 0.05, deck - 0.9), (x, near + 0.3, deck - 0.9), 0.18, 14) for x in xs]
    builder.mesh("port-holes", "steel-galvanised", union(ring))
    plates = bars([[(x, near - 0.01, base), (x, near - 0.01, deck)] for x in xs[::2]], 0.02)
    fender = bars([[(xs[0], near - 0.05, deck - 0.25), (xs[-1], near - 0.05, deck - 0.25)]], 0.1, 8)
    builder.mesh("plates", parameters.paint, union([plates, fender]))
    if not docked:
        tyres = [rod((x, near - 0.25, 0.2), (x, near, 0.2), 0.45, 18) for x in xs[::3]]
        builder.mesh("fenders", "rubber-black", union(tyres))
        ends = [
            ((x, near, deck), (x + d, -0.8, 0.3)) for x, d in ((xs[0], -4), (xs[-1], 4), (xs[2], 6))
        ]
        lines = [tube(hanging(a, b, 0.3, 15), 0.025, 6) for a, b in ends]
        builder.mesh("mooring lines", "nylon-fabric", union(lines))
    posts = np.arange(xs[0], xs[-1], 1.5)
    rails = [[(x, near + 0.15, deck), (x, near + 0.15, deck + 1.05)] for x in posts]
    rails += [
        [(posts[0], near + 0.15, deck + z), (posts[-1], near + 0.15, deck + z)]
        for z in (0.35, 0.7, 1.05)
    ]
    builder.mesh("ship railing", "steel-galvanised", bars(rails, 0.02, 5))
    house = _superstructure(builder, parameters, rng, x0 - 0.2 * length, y, deck, beam)
    mast = _mast(builder, parameters, rng, x0 + rng.uniform(-0.1, 0.2) * length, y, deck, beam)
    if parameters.scaffold == "tubes":
        _scaffold(builder, rng, xs[0], near - (1.4 if docked else 0.0), deck, docked)
    hull_position = np.array([rng.uniform(xs[0], xs[-1]), near, rng.uniform(0.35, 1.0) * deck])
    return {"hull": hull_position, "superstructure": house, "mast": mast}


def _superstructure(
    builder: SceneBuilder, parameters: ShipyardParameters, rng: np.random.Generator,
    x: float, y: float, deck: float, beam: float,
) -> Floats:  # fmt: skip
    """Add storeys of decreasing size, windows around, a funnel, life rafts and a radar."""
    length, parts, panes, z = 0.22 * parameters.ship_m, [], [], deck
    storeys = int(rng.integers(1, 4))
    for k in range(storeys):
        long, wide = length * (1 - 0.15 * k), 0.75 * beam * (1 - 0.1 * k)
        parts.append(block((long, wide, 2.6), (x, y, z + 1.3)))
        parts.append(block((long + 0.6, wide + 0.6, 0.12), (x, y, z + 2.6)))
        glass = np.arange(-long / 2 + 0.7, long / 2 - 0.4, 1.3)
        panes += [block((0.8, wide + 0.06, 0.7), (x + g, y, z + 1.6)) for g in glass]
        glass = np.arange(-wide / 2 + 0.7, wide / 2 - 0.4, 1.2)
        panes += [block((long + 0.06, 0.8, 0.7), (x, y + g, z + 1.6)) for g in glass]
        z += 2.6
    funnel = lathe([(0, 0), (0.9, 0), (0.75, 2.6), (0.6, 2.6), (0, 2.2)], 18)
    parts.append(moved(funnel, (x - 0.3 * length, y, z)))
    builder.mesh("superstructure", "paint-white", union(parts))
    builder.mesh("ship windows", "glass-painted-back", union(panes))
    aside, level = y - 0.37 * beam, deck + 3.1
    rafts = [rod((x + k, aside, level), (x + k + 1.2, aside, level), 0.32, 16) for k in (-2, 0.5)]
    builder.mesh("life rafts", "fibreglass", union(rafts))
    return np.array(
        [x + rng.uniform(-0.4, 0.4) * length, y - 0.37 * beam, rng.uniform(deck + 1, z)]
    )


def _mast(
    builder: SceneBuilder, parameters: ShipyardParameters, rng: np.random.Generator,
    x: float, y: float, deck: float, beam: float,
) -> Floats:  # fmt: skip
    """Pole or lattice with yards, radar, aerials, ladder, lamps and stays."""
    tall = parameters.mast_m
    top = deck + tall
    lattice = rng.random() < 0.5
    if lattice:
        panels = max(4, int(tall / 0.9))
        body = boom((x, y, deck), (x, y, top), (0.06 * tall, 0.12), panels, 0.04)
    else:
        body = lathe([(0, deck), (0.25, deck), (0.08, top), (0, top)], 14)
        body.apply_translation((x, y, 0))
    yards = [[(x, y - w, deck + f * tall), (x, y + w, deck + f * tall)]
             for f, w in zip((0.5, 0.68, 0.85), rng.uniform(0.8, 2.6, 3), strict=True)]  # fmt: skip
    aerials = [[(x, y + s * 0.6, deck + 0.85 * tall), (x, y + s * 0.6, top + 1.2)] for s in (-1, 1)]
    rungs = [
        [(x - 0.35, y - 0.2, z), (x - 0.35, y + 0.2, z)]
        for z in np.arange(deck + 0.5, top - 1, 0.3)
    ]
    rails = [[(x - 0.35, y + s * 0.2, deck), (x - 0.3, y + s * 0.2, top - 1)] for s in (-1, 1)]
    builder.mesh(
        "mast", "paint-white", union([body, bars(yards, 0.05, 8), bars(aerials, 0.015, 6)])
    )
    builder.mesh("mast ladder", "steel-galvanised", bars([*rungs, *rails], 0.014, 5))
    antenna = [block((0.25, 1.9, 0.14), (0.5, 0, 0.35)), block((0.9, 0.5, 0.05), (0.3, 0, -0.03))]
    radar = union([*antenna, rod((0.5, 0, 0), (0.5, 0, 0.3), 0.15, 14)])
    dome = lathe([(0, 0), (0.35, 0), (0.42, 0.3), (0.25, 0.62), (0, 0.7)], 18)
    level = deck + 0.6 * tall
    builder.mesh("radar", "fibreglass", radar, (x, y, level), (0, 0, rng.uniform(-60, 60)))
    builder.mesh("radome", "polypropylene", dome, (x - 0.5, y + 0.5, deck + 0.72 * tall))
    stays = []
    for s in (-1, 1):
        for n in range(parameters.stays):
            fraction = rng.uniform(0.45, 1.0)
            foot = (x + (n - 1) * rng.uniform(0.5, 2.0), y + s * 0.45 * beam, deck)
            stays.append([foot, (x, y, deck + fraction * tall)])
    stays += [[(x + d, y, deck), (x, y, top)] for d in (-0.9 * tall, 0.9 * tall)]
    builder.mesh("stays", "steel-galvanised", bars(stays, rng.uniform(0.004, 0.02), 6))
    if rng.random() < 0.5:
        line = hanging((x, y, top), (x + 0.9 * tall, y, deck + 1), 0.3, 12)
        flags = [block((0.45, 0.02, 0.3), point + np.array([0, 0, -0.2])) for point in line[1:-1]]
        builder.mesh("flags", "nylon-fabric", union(flags))
    return np.array([x, y, deck + rng.uniform(0.4, 1.0) * tall])


def _scaffold(
    builder: SceneBuilder,
    rng: np.random.Generator,
    start: float,
    near: float,
    deck: float,
    docked: bool,
) -> None:
    """Tubes and planks before the ship's side."""
    xs, zs = start + 2.0 * np.arange(9), np.arange(0.1, deck + 1, 2.0)
    front, back = near - 1.3 if docked else -1.4, near - 0.2 if docked else -0.2
    tubes = [[(x, y, 0), (x, y, zs[-1] + 1)] for x in xs for y in (front, back)]
    tubes += [
        [(xs[0], y, z + h), (xs[-1], y, z + h)] for z in zs for h in (0, 1.0) for y in (front,)
    ]
    tubes += [[(x, front, z), (x, back, z)] for x in xs for z in zs]
    tubes += [[(xs[k], front, zs[0]), (xs[k + 1], front, zs[-1])] for k in range(0, 8, 3)]
    builder.mesh("scaffold", "steel-galvanised", bars(tubes, 0.024, 7))
    planks = [
        block((16, 0.3, 0.05), (xs.mean(), y, z + 0.05))
        for z in zs
        for y in (front + 0.3, front + 0.65)
    ]
    builder.mesh("planks", "wood-weathered", union(planks))


def _containers(
    builder: SceneBuilder, parameters: ShipyardParameters, rng: np.random.Generator
) -> Floats:
    """Stacks of containers on the quay."""
    length, width, height = 6.06, 2.44, 2.59
    ribs = np.arange(-length / 2 + 0.3, length / 2 - 0.2, 0.28)
    parts = [block((length - 0.1, width - 0.1, height), (0, 0, height / 2))]
    parts += [block((0.14, width, height - 0.3), (x, 0, height / 2)) for x in ribs]
    parts += [
        block((length, 0.16, 0.16), (0, s * (width / 2 - 0.06), z))
        for s in (-1, 1)
        for z in (0.08, height - 0.08)
    ]
    parts += [
        block((0.16, 0.16, height), (s * (length / 2 - 0.06), t * (width / 2 - 0.06), height / 2))
        for s in (-1, 1)
        for t in (-1, 1)
    ]
    parts += [
        rod((length / 2, y, 0.3), (length / 2, y, height - 0.3), 0.03, 8)
        for y in (-0.7, -0.3, 0.3, 0.7)
    ]
    corner = np.array([rng.uniform(-25, 25), rng.uniform(-40, -16), 0.0])
    turn = float(rng.choice([0, 90])) + rng.uniform(-5, 5)
    kinds: list[list[Floats]] = [[], [], []]
    for column in range(4):
        for row in range(3):
            for storey in range(int(rng.integers(1, parameters.storeys + 1))):
                kinds[int(rng.integers(0, 3))].append(
                    np.array([column * (length + 0.15), row * (width + 0.1), storey * height])
                    + rng.uniform(-0.04, 0.04, 3) * (1, 1, 0)
                )
    solid = union(parts)
    for number, (material, own) in enumerate(
        zip(("steel-painted", "steel-rusty", "aluminium-rough"), kinds, strict=True)
    ):
        if own:
            builder.mesh(
                f"containers {number + 1}",
                material,
                spread(solid, own, 0, 1),
                tuple(corner),
                (0, 0, turn),
            )
    angle = np.radians(turn)
    local = np.array([rng.uniform(-3, 18), rng.choice([-1.2, 6.2]), 0])
    c, s = np.cos(angle), np.sin(angle)
    position = corner + np.array([c * local[0] - s * local[1], s * local[0] + c * local[1], 0])
    position[2] = rng.uniform(0.3, 1.1) * parameters.storeys * height
    return position


def _quay(builder: SceneBuilder, parameters: ShipyardParameters, rng: np.random.Generator) -> None:
    """Add the quay wall, bollards, rails, and objects, most of them before the drone."""
    wide = 2.5 * YARD_M
    builder.box("quay", "concrete-weathered", (wide, YARD_M, 4.0), (0, -YARD_M / 2, -2.0))
    edge = block((wide, 0.4, 0.2), (0, -0.2, 0.1))
    builder.mesh("quay edge", "concrete", edge)
    bollard = lathe([(0, 0), (0.25, 0), (0.2, 0.35), (0.32, 0.45), (0.3, 0.55), (0, 0.6)], 16)
    x = np.arange(-40, 40, rng.uniform(5, 12))
    builder.mesh(
        "bollards", "steel-rusty", spread(bollard, np.column_stack([x, 0 * x - 0.9, 0 * x]), 0, 1)
    )
    eye, aim = np.asarray(builder.position_m), np.asarray(builder.look_at_m)
    view = (aim - eye)[:2] / np.linalg.norm((aim - eye)[:2])
    across = np.array([-view[1], view[0]])
    things: list[tuple[str, str, Mesh]] = [
        ("drums", "steel-rusty", drum()),
        ("pallets", "wood-weathered", pallet()),
        ("cones", "polypropylene", cone()),
        ("crates", "plywood", block((1.0, 0.8, 0.8), (0, 0, 0.4))),
        ("gas bottles", "steel-painted", gas_cylinder()),
    ]
    for number, (name, material, mesh) in enumerate(things):
        n = len(range(number, parameters.clutter, len(things)))
        ahead = rng.uniform(3, 25, n)
        flat = (
            eye[:2] + ahead[:, None] * view + (ahead * rng.uniform(-0.2, 0.2, n))[:, None] * across
        )
        flat = flat[(flat[:, 1] < -1.2) & (flat[:, 1] > 1 - YARD_M)]
        if len(flat):
            feet = np.column_stack([flat, np.zeros(len(flat))])
            builder.mesh(name, material, spread(mesh, feet, rng.uniform(0, 360, len(flat)), 1))
    if rng.random() < 0.4:
        at = eye[:2] + rng.uniform(4, 10) * view
        if -YARD_M < at[1] < -1:
            add_worker(builder, (*at, 0.0), (0, 0, rng.uniform(0, 360)))


def _water(
    builder: SceneBuilder, parameters: ShipyardParameters, rng: np.random.Generator
) -> Terrain:
    """The basin before the quay, the far shore, flat land behind the yard."""
    far, rolling = hills(rng, rng.uniform(400, 1200), parameters.hills_m), waves(rng, (60, 400))

    def relief(x: Floats, y: Floats) -> Floats:
        behind = np.clip(-YARD_M - y, -3, 1.5)
        shore = np.clip((y - shore_m) / 40, -3, 4)
        return np.where(y > 0, WATER_M + shore, WATER_M + behind) + np.where(
            (y > shore_m) | (y < -YARD_M), far(x, y) + 0.5 + 0.5 * rolling(x, y), 0
        )

    shore_m = rng.uniform(250, 900)
    land = terrain(relief, ((-40, 40), (-70, 60)), 5.0)
    grounds = ["gravel", str(rng.choice(["grass", "soil-field"]))]
    return add_shore(builder, land, WATER_M, grounds, patchwork(rng, land, 2, 20.0))


FAMILY = Family(
    "A shipyard: a hull, masts and stays, cranes, containers, water and sky",
    ShipyardParameters,
    build,
    min_spots=1,
)
