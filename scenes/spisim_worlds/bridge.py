"""A bridge as seen by an inspection drone: deck, girders, truss, arch or cables, piers, water."""

from collections.abc import Callable

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, Point, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.boats import add_boat
from spisim_worlds.parts.lattice import boom
from spisim_worlds.parts.props import add_worker
from spisim_worlds.parts.shapes import Mesh, bars, block, lathe, rod, spread, union
from spisim_worlds.parts.terrain import Terrain, add_shore, hills, patchwork, terrain, waves
from spisim_worlds.parts.vehicles import add_car, add_van
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view

#: The deck extends this far behind and ahead of the drone.
BEHIND_M, AHEAD_M = -60.0, 210.0


class BridgeParameters(Parameters):
    """The drone flies beside, over or below the deck, and looks along it or across."""

    kind: str = one_of("girder", "truss", "arch", "stayed", "suspension", text="of the bridge")
    bridge_deg: float = drawn(12.0, 88.0, "of the bridge to the line of sight")
    side: str = one_of("left", "right", text="where the bridge is")
    aside_m: float = drawn_log(1.5, 16.0, "from the drone to the near edge of the deck")
    above_m: float = drawn(-8.0, 7.0, "how much higher than the deck the drone flies")
    look_m: float = drawn(-4.0, 4.5, "height looked at, where the deck is met or 25 m ahead")
    beside_deg: float = drawn(-15.0, 15.0, "of the line of sight beside that, to the left")
    clearance_m: float = drawn(8.0, 40.0, "of the deck above the water")
    width_m: float = drawn(2.5, 14.0, "of the deck")
    girders: int = drawn(2, 5, "below the deck")
    girder_m: float = drawn(0.5, 2.4, "height of these")
    panel_m: float = drawn(3.0, 8.0, "of truss, or between hangers")
    truss_m: float = drawn(2.5, 7.0, "height of the truss, or of tower and arch in tenths")
    pier_span_m: float = drawn(18.0, 60.0, "between piers")
    pier: str = one_of("wall", "columns", "lattice", text="what carries it")
    railing: str = one_of("bars", "rails", "parapet", text="along the deck")
    steel: str = one_of(
        "steel-painted", "steel-rusty", "steel-galvanised", "concrete", text="of what carries"
    )
    river_m: float = drawn_log(20.0, 400.0, "width of the water")
    hills_m: float = drawn(0.0, 400.0, "height of the hills behind")
    traffic: str = one_of("none", "car", "van", "person", text="on the deck")
    boats: int = drawn(0, 3, "on the water")


def build(parameters: BridgeParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the deck at z = 0 and the drone over the origin, looking along x."""
    eye = (0.0, 0.0, parameters.above_m)
    ahead = min(parameters.aside_m / np.sin(np.radians(parameters.bridge_deg)) + 1.0, 25.0)
    aim = (ahead, ahead * float(np.tan(np.radians(parameters.beside_deg))), parameters.look_m)
    builder = SceneBuilder(eye, aim, **outdoors(rng))
    at, turn = _frame(parameters)
    land = _land(builder, parameters, rng, at, turn)
    _deck(builder, parameters, rng, at, turn)
    _piers(builder, parameters, rng, land, at, turn)
    _CARRIERS[parameters.kind](builder, parameters, rng, at, turn)
    _on_deck(builder, parameters, rng, at, turn)
    for number in range(parameters.boats):
        x, y, _ = in_view(rng, land, 1, 12, 120)[0]
        if land.height(x, y) < 0.05 - parameters.clearance_m:
            position = (x, y, -parameters.clearance_m)
            add_boat(builder, rng, f"boat {number + 1}", position, rng.uniform(0, 360))
    return builder


def _frame(parameters: BridgeParameters) -> tuple[Floats, Floats]:
    """Return origin and rotation [roll, pitch, yaw] of the bridge, whose axis is x at y = 0."""
    way = 1 if parameters.side == "left" else -1
    angle = np.radians(way * parameters.bridge_deg) * -1
    off = parameters.aside_m + parameters.width_m / 2
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    return way * off * normal, np.array([0.0, 0.0, np.degrees(angle)])


def _world(at: Floats, turn: Floats, points: Floats) -> Floats:
    """Return world positions (n, 2) of coordinates along and across the bridge."""
    angle = np.radians(turn[2])
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + at[:2])


def _land(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> Terrain:
    """Add water below, banks up to the deck at its ends, and hills."""
    level = -parameters.clearance_m
    middle, half = rng.uniform(-20, 90), parameters.river_m / 2
    rolling, slope = waves(rng, (25, 150)), rng.uniform(0.25, 1.2)
    far = hills(rng, rng.uniform(300, 900), parameters.hills_m)
    angle = np.radians(turn[2])

    def relief(x: Floats, y: Floats) -> Floats:
        along = (x - at[0]) * np.cos(angle) + (y - at[1]) * np.sin(angle)
        from_water = np.abs(along - middle + 0.2 * half * rolling(x / 4, y / 4)) - half
        bank = np.minimum(slope * from_water, parameters.clearance_m - 1.5 + 2 * rolling(x, y))
        return level + bank + np.where(bank > 0, far(x, y), 0)

    land = terrain(relief, ((-10, 70), (-25, 25)), 1.8)
    grounds = [
        str(kind) for kind in rng.permutation(["grass", "gravel", "soil-field", "rock-granite"])[:2]
    ]
    land = add_shore(builder, land, level, grounds, patchwork(rng, land, 2, 10.0))
    spots = in_view(rng, land, 14, 12, 150)
    dry = spots[spots[:, 2] > level + 0.5]
    away = np.abs((dry[:, :2] - at[:2]) @ (-np.sin(angle), np.cos(angle)))
    kinds = [str(kind) for kind in rng.permutation(sorted(TREES))[:2]]
    add_wood(builder, "tree", kinds, "leaves-green", rng,
             dry[away > 6 + parameters.width_m / 2], rng.uniform(4, 14))  # fmt: skip
    add_far_woods(builder, rng, land, int(rng.integers(2, 8)), 200.0)
    return land


def _deck(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """Slab, kerbs, girders with flanges, cross beams, railings on both sides, a pipe below."""
    length, middle = AHEAD_M - BEHIND_M, (AHEAD_M + BEHIND_M) / 2
    half, deep = parameters.width_m / 2, parameters.girder_m
    slab = [block((length, 2 * half, 0.25), (middle, 0, -0.125))]
    slab += [block((length, 0.35, 0.35), (middle, s * (half - 0.17), 0.0)) for s in (-1, 1)]
    builder.mesh("deck", "concrete-weathered", union(slab), at, turn)
    road = block((length, 2 * half - 0.8, 0.02), (middle, 0, 0.01))
    builder.mesh("road", "asphalt", road, at, turn)
    beams = []
    for y in np.linspace(-0.8, 0.8, parameters.girders) * half:
        beams.append(block((length, 0.05, deep), (middle, y, -0.25 - deep / 2)))
        beams += [block((length, 0.4, 0.05), (middle, y, -0.25 - z)) for z in (0.03, deep)]
        stiff = [
            block((0.02, 0.3, deep), (x, y, -0.25 - deep / 2)) for x in np.arange(-20, 60, 1.9)
        ]
        beams += stiff
    beams += [block((0.15, 2 * half * 0.8, 0.4 * deep), (x, 0, -0.3 - 0.35 * deep))
              for x in np.arange(BEHIND_M, AHEAD_M, parameters.panel_m)]  # fmt: skip
    builder.mesh("girders", parameters.steel, union(beams), at, turn)
    y = half - 0.12
    posts = np.arange(BEHIND_M, 110, rng.uniform(1.4, 2.6))
    high = rng.uniform(0.95, 1.3)
    if parameters.railing == "parapet":
        rail = union([block((length, 0.2, high), (middle, s * y, high / 2)) for s in (-1, 1)])
    else:
        segments = [[(x, s * y, 0), (x, s * y, high)] for x in posts for s in (-1, 1)]
        levels = [high] if parameters.railing == "bars" else np.linspace(0.25, high, 4)
        rails = [[(BEHIND_M, s * y, z), (AHEAD_M, s * y, z)] for s in (-1, 1) for z in levels]
        parts = [bars(segments, 0.035, 6), bars(rails, 0.03, 6)]
        if parameters.railing == "bars":
            fine = np.arange(-12, 70, 0.13)
            thin = [[(x, s * y, 0.1), (x, s * y, high)] for x in fine for s in (-1, 1)]
            parts.append(bars(thin, 0.008))
        rail = union(parts)
    railing = "concrete" if parameters.railing == "parapet" else "steel-galvanised"
    builder.mesh("railing", railing, rail, at, turn)
    if rng.random() < 0.5:
        y, z, wide = 0.6 * half, -0.4 - 0.5 * deep, rng.uniform(0.05, 0.25)
        builder.mesh(
            "pipe", "steel-galvanised", rod((BEHIND_M, y, z), (AHEAD_M, y, z), wide, 14), at, turn
        )


def _piers(
    builder: SceneBuilder, parameters: BridgeParameters, rng: np.random.Generator, land: Terrain,
    at: Floats, turn: Floats,
) -> None:  # fmt: skip
    """Add piers into the ground or water, with a cap below the girders."""
    half, top = parameters.width_m / 2, -0.25 - parameters.girder_m
    first = rng.uniform(0, parameters.pier_span_m)
    along = np.arange(first - parameters.pier_span_m, AHEAD_M, parameters.pier_span_m)
    flat = _world(at, turn, np.column_stack([along, 0 * along]))
    parts = []
    for x, foot in zip(along, land.height(*flat.T), strict=True):
        low = float(foot) - 3
        if low > top - 1:
            continue
        middle, tall = (low + top) / 2, top - low
        parts.append(block((1.4, 1.8 * half, 0.7), (x, 0, top - 0.35)))
        if parameters.pier == "wall":
            parts.append(block((1.0, 1.4 * half, tall), (x, 0, middle)))
        elif parameters.pier == "columns":
            parts += [
                rod((x, s * 0.6 * half, low), (x, s * 0.6 * half, top), 0.5, 18) for s in (-1, 1)
            ]
        else:
            panels = max(2, int(tall / 2.5))
            for y in (-0.6 * half, 0.6 * half):
                parts.append(boom((x, y, low), (x, y, top), (0.9, 0.5), panels, 0.08))
        parts.append(block((3.0, 1.8 * half, 2.5), (x, 0, low + 2.2)))
    if parts:
        material = "steel-rusty" if parameters.pier == "lattice" else "concrete-weathered"
        builder.mesh("piers", material, union(parts), at, turn)


def _girder(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """Add only girders, and sometimes an inspection cradle below them."""
    if rng.random() < 0.5:
        half, low = parameters.width_m / 2, -1.2 - parameters.girder_m
        x = rng.uniform(5, 25)
        cradle = boom((x, -half - 0.5, low), (x, half + 0.5, low), (0.45, 0.45), 8, 0.03)
        arms = bars(
            [[(x, s * (half + 0.4), low), (x, s * (half + 0.4), 0.2)] for s in (-1, 1)], 0.05
        )
        builder.mesh("cradle", "aluminium-rough", union([cradle, arms]), at, turn)


def _truss(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """Trusses on both sides, above the deck with bracing on top, or below it."""
    half, tall, step = parameters.width_m / 2 + 0.15, parameters.truss_m, parameters.panel_m
    below = rng.random() < 0.4
    low, high = (-0.3 - tall, -0.3) if below else (-0.3, tall)
    joints = np.arange(-30, AHEAD_M, step)
    thick: list[tuple[Point, Point]] = []
    thin: list[tuple[Point, Point]] = []
    warren = rng.random() < 0.5
    for s in (-1, 1):
        y = s * half
        thick += [((joints[0], y, z), (joints[-1], y, z)) for z in (low, high)]
        for n, x in enumerate(joints[:-1]):
            up = n % 2 == 0
            thin.append(((x, y, low if up else high), (x + step, y, high if up else low)))
            if not warren:
                thin.append(((x, y, low), (x, y, high)))
                if rng.random() < 0.2:
                    thin.append(((x, y, high if up else low), (x + step, y, low if up else high)))
    for n, x in enumerate(joints[:-1]):
        z = low if below else high
        thin.append(((x, -half, z), (x, half, z)))
        cross = (-half, half) if n % 2 else (half, -half)
        thin.append(((x, cross[0], z), (x + step, cross[1], z)))
    wide = rng.uniform(0.12, 0.28)
    plates = [
        block((0.7, 0.06, 0.6), (x, s * half, z))
        for x in joints[:40]
        for s in (-1, 1)
        for z in (low, high)
    ]
    truss = union([bars(thick, wide), bars(thin, 0.6 * wide), *plates])
    builder.mesh("truss", parameters.steel, truss, at, turn)


def _arch(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """Arches above the deck, which hangs from them, or below it, on which it stands."""
    half = parameters.width_m / 2 + 0.3
    rise = 3.5 * parameters.truss_m
    span = rng.uniform(50, 130)
    start = rng.uniform(-0.6, 0.1) * span
    t = np.linspace(0, 1, 41)
    x = start + span * t
    above = rng.random() < 0.6
    z = 4 * rise * t * (1 - t) if above else -0.6 - parameters.girder_m - rise * (1 - 2 * t) ** 2
    ribs, ties = [], []
    for s in (-1, 1):
        line = np.column_stack([x, np.full(41, s * half), z])
        ribs.append(np.stack([line[:-1], line[1:]], axis=1))
        for at_x in np.arange(start + parameters.panel_m, start + span, parameters.panel_m):
            high = float(np.interp(at_x, x, z))
            ties.append([(at_x, s * half, 0.0), (at_x, s * half, high)])
    across = np.column_stack([x[::3], np.full(14, -half), z[::3]])
    ties_across = [[a, a * (1, -1, 1)] for a in across[2:-2]]
    thick = rng.uniform(0.25, 0.5)
    arches = union([bars(np.concatenate(ribs), thick), bars(ties_across, 0.6 * thick)])
    builder.mesh("arches", parameters.steel, arches, at, turn)
    builder.mesh("hangers", "steel-galvanised", bars(ties, 0.03 if above else 0.2, 8), at, turn)


def _towers(parameters: BridgeParameters, x: float) -> list[Mesh]:
    """Legs on both sides of the deck, tapered, with cross beams."""
    half, tall = parameters.width_m / 2 + 0.8, 6 * parameters.truss_m
    legs = [_leg(x, s * half, -parameters.clearance_m - 3, tall) for s in (-1, 1)]
    beams = [block((1.2, 2 * half, 1.2), (x, 0, z)) for z in (-1.5 - parameters.girder_m, tall - 1)]
    return [*legs, *beams]


def _leg(x: float, y: float, low: float, high: float) -> Mesh:
    """Leg of a tower, thinner at the top."""
    leg = lathe([(0, low), (1.3, low), (0.8, high), (0, high)], 4)
    return leg.apply_translation((x, y, 0))


def _stayed(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """A tower and a fan or a harp of stays on both sides."""
    x, tall = rng.uniform(4, 45), 6 * parameters.truss_m
    builder.mesh("tower", "concrete", union(_towers(parameters, x)), at, turn)
    half = parameters.width_m / 2 - 0.05
    fan = rng.random() < 0.5
    stays = []
    for n in range(1, 15):
        high = tall - 1 - (0.4 * n if fan else 0.055 * tall * (14 - n))
        for way in (-1, 1):
            stays += [[(x, s * (half + 0.8), high), (x + way * n * parameters.panel_m, s * half, 0)]
                      for s in (-1, 1)]  # fmt: skip
    builder.mesh("stays", "polyethylene-black" if fan else "steel-galvanised",
               bars(stays, rng.uniform(0.03, 0.1), 8), at, turn)  # fmt: skip


def _suspension(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """Two towers, main cables between them, hangers down to the deck."""
    x, tall, span = rng.uniform(-25, 15), 4 * parameters.truss_m, rng.uniform(70, 160)
    builder.mesh(
        "towers",
        parameters.steel,
        union([*_towers(parameters, x), *_towers(parameters, x + span)]),
        at,
        turn,
    )
    half = parameters.width_m / 2 + 0.1
    main, hangers = [], []
    t = np.linspace(0, 1, 61)
    z = tall - 0.5 - 4 * (tall - 2.5) * t * (1 - t)
    for s in (-1, 1):
        line = np.column_stack([x + span * t, np.full(61, s * half), z])
        main.append(np.stack([line[:-1], line[1:]], axis=1))
        main.append(np.array([[(x, s * half, tall - 0.5), (x - 0.4 * span, s * half, 0)]]))
        main.append(np.array([[(x + span, s * half, tall - 0.5), (x + 1.4 * span, s * half, 0)]]))
        for at_x in np.arange(x + 2, x + span, parameters.panel_m):
            high = float(np.interp(at_x, x + span * t, z))
            hangers.append([(at_x, s * half, 0), (at_x, s * half, high)])
    builder.mesh(
        "main cables",
        "steel-galvanised",
        bars(np.concatenate(main), rng.uniform(0.08, 0.25), 10),
        at,
        turn,
    )
    builder.mesh(
        "hangers", "steel-galvanised", bars(hangers, rng.uniform(0.015, 0.04), 6), at, turn
    )


_CARRIERS: dict[
    str, Callable[[SceneBuilder, BridgeParameters, np.random.Generator, Floats, Floats], None]
] = {
    "girder": _girder,
    "truss": _truss,
    "arch": _arch,
    "stayed": _stayed,
    "suspension": _suspension,
}


def _on_deck(
    builder: SceneBuilder,
    parameters: BridgeParameters,
    rng: np.random.Generator,
    at: Floats,
    turn: Floats,
) -> None:
    """Lamp posts, traffic."""
    half = parameters.width_m / 2
    tall = rng.uniform(4, 9)
    lamp = union([rod((0, 0, 0), (0, 0, tall), 0.06, 10), block((0.15, 0.9, 0.1), (0, -0.4, tall))])
    x = np.arange(rng.uniform(-20, 0), AHEAD_M, rng.uniform(14, 35))
    positions = np.column_stack([x, np.full(len(x), half - 0.3), 0 * x])
    if rng.random() < 0.7:
        builder.mesh("lamp posts", "steel-galvanised", spread(lamp, positions, 0, 1), at, turn)
    crossing = parameters.aside_m / np.tan(np.radians(parameters.bridge_deg))
    along = crossing + rng.uniform(-2, 8)
    ((x_world, y_world),) = _world(at, turn, np.array([[along, rng.uniform(-0.4, 0.4) * half]]))
    position, way = (x_world, y_world, 0.02), (0, 0, turn[2] + float(rng.choice([0, 180])))
    if parameters.traffic == "person":
        add_worker(builder, position, way)
    elif parameters.traffic != "none" and parameters.width_m > 4:
        (add_car if parameters.traffic == "car" else add_van)(builder, position, way)


FAMILY = Family(
    "A bridge of girders, truss, arch or cables over water, its piers and railings",
    BridgeParameters,
    build,
    min_spots=1,
)
