"""A landing site seen at a slant, pad, road or flat roof, and the land to the horizon."""

from collections.abc import Callable

import numpy as np

from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.houses import add_houses
from spisim_worlds.parts.natural import scattered_rocks
from spisim_worlds.parts.props import add_worker, cone, drum, pallet
from spisim_worlds.parts.shapes import Mesh, bars, block, lathe, rod, spread, union
from spisim_worlds.parts.terrain import Terrain, hills, patchwork, terrain, waves
from spisim_worlds.parts.vehicles import add_car, add_van
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view, scattered_tufts

GROUNDS = ("grass", "soil-field", "gravel", "sand-dry", "leaves-dry")


class LandingApproachParameters(Parameters):
    """The drone descends towards the site and looks at it, or over it."""

    place: str = one_of("pad", "road", "roof", "runway", text="to land on")
    height_m: float = drawn_log(1.2, 8.0, "of the drone above the place")
    slant_deg: float = drawn(0.0, 24.0, "of the line of sight below the horizon")
    turn_deg: float = drawn(-90.0, 90.0, "of the place to the line of sight")
    roll_deg: float = drawn(-6.0, 6.0, "of the drone as it turns in")
    aside_deg: float = drawn(-7.0, 7.0, "of the middle of the place, to the left")
    size_m: float = drawn_log(1.5, 12.0, "side of the pad, or half the width of road and roof")
    surface: str = one_of(
        "concrete", "asphalt", "steel-painted", "gravel", "grass", text="of the place"
    )
    clutter: int = drawn(0, 10, "things that stand about")
    vehicle: str = one_of("none", "car", "van", text="parked beside")
    trees: int = drawn(0, 14, "around the place")
    houses: int = drawn(0, 4, "beyond")
    wires: str = one_of("none", "power-line", "lamp-posts", "fence", text="across the approach")
    building_m: float = drawn(4.0, 16.0, "height of the roof above the land")
    hills_m: float = drawn(0.0, 400.0, "height of the hills behind")


def build(parameters: LandingApproachParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene; the middle of the site is ahead on the line of sight, at z = 0."""
    on_roof = parameters.place == "roof"
    level = -parameters.building_m if on_roof else 0.0
    middle = _middle(parameters)
    rolling = waves(rng, (15, 80))
    far = hills(rng, rng.uniform(300, 900), parameters.hills_m)
    flat = 1.2 * parameters.size_m + 2

    def relief(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        away = np.clip((np.hypot(x - middle[0], y - middle[1]) - flat) / 20, 0, 1)
        return level - 0.02 + away * (0.6 + 0.6 * rolling(x, y)) + far(x, y)

    land = terrain(relief, ((-2, 45), (-12, 12)), 1.0)
    eye = (0.0, 0.0, parameters.height_m)
    aim = (10.0, 0.0, parameters.height_m - 10 * np.tan(np.radians(parameters.slant_deg)))
    builder = SceneBuilder(eye, aim, **outdoors(rng))
    grounds = [str(kind) for kind in rng.permutation(GROUNDS)[:3]]
    land.add(builder, grounds, patchwork(rng, land, 3, 5.0))
    _POSITIONS[parameters.place](builder, parameters, rng, land)
    _around(builder, parameters, rng, land)
    _ACROSS[parameters.wires](builder, parameters, rng, land)
    return builder


def _middle(parameters: LandingApproachParameters) -> np.ndarray:
    """Return (x, y) of the middle of the site, which is not under the drone."""
    distance = parameters.height_m / np.tan(np.radians(parameters.slant_deg + 2))
    distance = float(np.clip(distance, 1.2 * parameters.size_m, 14 + 1.5 * parameters.size_m))
    angle = np.radians(parameters.aside_deg)
    return np.array([distance, distance * np.tan(angle)])


def _turned(parameters: LandingApproachParameters, x: float, y: float) -> tuple[float, float]:
    """Return the world position of one given along and across the site."""
    angle = np.radians(parameters.turn_deg)
    c, s = np.cos(angle), np.sin(angle)
    to = _middle(parameters) + np.array([c * x - s * y, s * x + c * y])
    return float(to[0]), float(to[1])


def _pad(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """A square or a disc with a letter H or a cross, a rim and lamps around it."""
    at, turn = (*_middle(parameters), 0.0), (0, 0, parameters.turn_deg)
    size, thick = parameters.size_m, rng.uniform(0.05, 0.5)
    if rng.random() < 0.5:
        builder.box("pad", parameters.surface, (size, size, thick), (*at[:2], -thick / 2 + 0.02),
                  turn)  # fmt: skip
    else:
        builder.cylinder("pad", parameters.surface, (size / 2, thick), (*at[:2], -thick / 2 + 0.02))
    lifted = (*at[:2], 0.025)
    bar = 0.12 * size
    if rng.random() < 0.5:
        marks = [block((0.55 * size, bar, 0.01), (0, s * 0.2 * size, 0)) for s in (-1, 1)]
        marks.append(block((bar, 0.4 * size, 0.01), (0, 0, 0)))
    else:
        marks = [
            block((0.8 * size, bar, 0.01), (0, 0, 0)),
            block((bar, 0.8 * size, 0.01), (0, 0, 0)),
        ]
    marking = (
        "paint-white" if parameters.surface in ("asphalt", "grass", "gravel") else "paint-black"
    )
    builder.mesh("marking", marking, union(marks), lifted, turn)
    lamp = lathe([(0, 0), (0.07, 0), (0.07, 0.08), (0.05, 0.2), (0, 0.22)], sections=10)
    around = np.linspace(0, 2 * np.pi, 9)[:-1]
    positions = 0.78 * size * np.column_stack([np.cos(around), np.sin(around), 0 * around])
    builder.mesh("lamps", "aluminium-rough", spread(lamp, positions, 0, 1), (*at[:2], -0.02), turn)


def _road(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """A road with markings, kerbs and reflector posts, straight or in a bend."""
    half = 0.5 * parameters.size_m + 1.5
    bend = rng.uniform(-0.012, 0.012)
    s = np.concatenate([-np.geomspace(200, 1, 40), [0.0], np.geomspace(1, 400, 50)])
    path = np.array([_turned(parameters, float(t), float(bend * t * abs(t) / 4)) for t in s])
    builder.mesh("road", parameters.surface if parameters.surface != "steel-painted" else "asphalt",
               land.draped(path, 2 * half, 0.03))  # fmt: skip
    edges = [land.draped(path + _beside(path, way * (half - 0.25)), 0.14, 0.05) for way in (-1, 1)]
    dense = np.arange(-40, 90, 4.0)
    dashes = []
    for t in dense:
        ends = [np.array(_turned(parameters, u, bend * u * abs(u) / 4)) for u in (t, t + 1, t + 2)]
        dashes.append(land.draped(ends, 0.14, 0.05))
    builder.mesh("road marking", "paint-road-marking", union([*edges, *dashes]))
    if rng.random() < 0.6:
        post = block((0.06, 0.12, 1.3), (0, 0, 0.35))
        near = path[np.hypot(*path.T) < 130]
        spots = np.array([near + _beside(near, way * (half + 0.5)) for way in (-1, 1)])[:, ::4]
        builder.mesh("reflector posts", "paint-white",
                   spread(post, land.positions(*spots.reshape(-1, 2).T), 0, 1))  # fmt: skip


def _beside(path: np.ndarray, off: float) -> np.ndarray:
    along = np.gradient(path, axis=0)
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    return off * left / np.linalg.norm(left, axis=1, keepdims=True)


def _runway(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """A strip of grass or asphalt with threshold bars, cones or lamps along its edges."""
    half = parameters.size_m + 2
    ends = np.array([_turned(parameters, float(t), 0.0) for t in np.geomspace(1, 500, 40) - 6])
    surface = "grass" if parameters.surface == "grass" else "asphalt"
    builder.mesh("runway", surface, land.draped(ends, 2 * half, 0.03))
    bars_ = []
    for k in np.arange(-3, 3) + 0.5:
        y = k * half / 3.3
        line = np.array([_turned(parameters, t, y) for t in (-3.0, 0.0, 3.0)])
        bars_.append(land.draped(line, 0.16 * half, 0.05))
    builder.mesh("threshold", "paint-white", union(bars_))
    markers = [
        land.on(*_turned(parameters, t, way * half))
        for t in np.arange(-4.0, 60.0, 5.0)
        for way in (-1, 1)
    ]
    builder.mesh("edge markers", "polypropylene", spread(cone(), markers, 0, 1.0))


def _roof(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """A flat roof with a parapet, vents, a skylight, air conditioners and an aerial."""
    half_x, half_y = parameters.size_m + 2, (parameters.size_m + 2) * rng.uniform(0.6, 1.4)
    deep = parameters.building_m + 3
    at, turn = (*_middle(parameters), 0.0), (0, 0, parameters.turn_deg)
    walls = str(rng.choice(["brick", "concrete", "plaster"]))
    builder.box(
        "building", walls, (2 * half_x, 2 * half_y, deep), (*at[:2], -deep / 2 - 0.02), turn
    )
    cover = str(rng.choice(["roofing-felt", "gravel", "concrete-weathered", "metal-roof"]))
    builder.box("roof", cover, (2 * half_x, 2 * half_y, 0.04), (*at[:2], -0.01), turn)
    high = rng.uniform(0.15, 0.9)
    rim = [block((2 * half_x + 0.3, 0.3, high), (0, s * half_y, high / 2)) for s in (-1, 1)]
    rim += [block((0.3, 2 * half_y + 0.3, high), (s * half_x, 0, high / 2)) for s in (-1, 1)]
    builder.mesh("parapet", "concrete", union(rim), at, turn)
    unit = [
        block((1.1, 0.8, 0.9), (0, 0, 0.6)),
        *(block((0.08, 0.8, 0.15), (s, 0, 0.08)) for s in (-0.4, 0.4)),
    ]
    unit.append(rod((0, 0, 1.0), (0, 0, 1.1), 0.33, sections=16))
    vent = lathe(
        [(0, 0), (0.16, 0), (0.13, 0.5), (0.28, 0.52), (0.28, 0.6), (0, 0.75)], sections=14
    )
    dome = lathe([(0.75, 0), (0.75, 0.25), (0.6, 0.42), (0.3, 0.52), (0, 0.55)], sections=4)
    stack = [block((0.7, 0.7, 1.6), (0, 0, 0.8)), block((0.85, 0.85, 0.12), (0, 0, 1.55))]
    aerial = [rod((0, 0, 0), (0, 0, 2.6), 0.025, 6)]
    aerial += [
        rod((-0.4, y, 2.4 - abs(y)), (0.4, y, 2.4 - abs(y)), 0.008, 5) for y in (-0.2, 0, 0.2)
    ]
    things = [
        ("air conditioner", "steel-painted", union(unit)), ("vent", "steel-galvanised", vent),
        ("skylight", "pet-clear", dome), ("chimney", "brick", union(stack)),
        ("aerial", "aluminium-anodised", union(aerial)),
    ]  # fmt: skip
    for name, material, mesh in things:
        n = int(rng.integers(0, 4))
        flat = rng.uniform(-0.85, 0.85, (n, 2)) * (half_x, half_y)
        if n:
            builder.mesh(name, material, spread(mesh, np.column_stack([flat, np.full(n, 0.01)]),
                       rng.uniform(0, 360, n), rng.uniform(0.7, 1.3, n)), at, turn)  # fmt: skip


_POSITIONS: dict[
    str, Callable[[SceneBuilder, LandingApproachParameters, np.random.Generator, Terrain], None]
]
_POSITIONS = {"pad": _pad, "road": _road, "roof": _roof, "runway": _runway}


def _around(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """Add objects on and beside the site, and trees, houses and woods beyond."""
    size = parameters.size_m
    things: list[tuple[str, str, Mesh]] = [
        ("cones", "polypropylene", cone()), ("drums", "steel-rusty", drum()),
        ("pallets", "wood-dry", pallet()),
        ("boxes", "cardboard", block((0.6, 0.4, 0.4), (0, 0, 0.2))),
    ]  # fmt: skip
    for number, (name, material, mesh) in enumerate(things):
        n = len(range(number, parameters.clutter, len(things)))
        if not n:
            continue
        positions = []
        for _ in range(n):
            x, y = _turned(parameters, *rng.uniform(-0.9, 0.9, 2) * (size + 1))
            positions.append((x, y, 0.02) if parameters.place == "roof" else land.on(x, y, -0.03))
        builder.mesh(name, material, spread(mesh, positions, rng.uniform(0, 360, n), 1))
    if parameters.place == "roof":
        spots = land.positions(*_ring(rng, parameters, parameters.trees, 2.4 * size + 8, 60).T)
        tall = parameters.building_m * rng.uniform(0.7, 1.1)
    else:
        builder.mesh("grass", "grass", scattered_tufts(rng, land, 700, 2 * size + 4, 60, 0.3))
        spots = land.positions(*_ring(rng, parameters, parameters.trees, 1.3 * size + 5, 50).T)
        tall = rng.uniform(2.5, 12)
        at = (*_turned(parameters, *rng.uniform(-1, 1, 2) * size), 0.03)
        if rng.random() < 0.3:
            add_worker(builder, at, (0, 0, rng.uniform(0, 360)))
        beside = land.on(
            *_turned(parameters, rng.uniform(0, size), rng.choice([-1, 1]) * (size + 2))
        )
        turn = (0, 0, parameters.turn_deg + rng.choice([0, 180]) + rng.uniform(-10, 10))
        if parameters.vehicle != "none":
            (add_car if parameters.vehicle == "car" else add_van)(builder, beside, turn)
    kinds = [str(kind) for kind in rng.permutation(sorted(TREES))[:2]]
    add_wood(builder, "tree", kinds, "leaves-green", rng, spots, tall)
    far = in_view(rng, land, parameters.houses, 2.5 * size + 30, 250)
    add_houses(builder, rng, [land.on(x, y, 0.0) for x, y, _ in far])
    add_far_woods(builder, rng, land, int(rng.integers(2, 9)), 120.0)
    rocks = in_view(rng, land, 25, 1.5 * size + 4, 40)
    builder.mesh(
        "stones", "rock-granite", scattered_rocks(rng, rocks, rng.lognormal(-1.8, 0.5, 25))
    )


def _ring(
    rng: np.random.Generator, parameters: LandingApproachParameters, n: int, low: float, high: float
) -> np.ndarray:
    """Return positions (n, 2) ahead, at a distance from the site and not near the drone."""
    result = np.empty((0, 2))
    while len(result) < n:
        angle = rng.uniform(-np.pi, np.pi, 64)
        flat = rng.uniform(low, high, 64)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
        flat += _middle(parameters)
        seen = np.abs(np.degrees(np.arctan2(flat[:, 1], flat[:, 0]))) < 16
        result = np.concatenate([result, flat[seen & (np.hypot(*flat.T) > 9)]])
    return result[:n]


def _nothing(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """Leave the approach free."""


def _power_line(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """Add wires across the view, before or behind the site."""
    x, slope = rng.uniform(2.5, 12.0), rng.uniform(-0.3, 0.3)
    z = parameters.height_m - x * np.tan(np.radians(parameters.slant_deg + rng.uniform(-7, 7)))
    wires = []
    for k in range(int(rng.integers(1, 5))):
        y = np.linspace(-30, 30, 41)
        line = np.column_stack([x + 0.5 * k + slope * y, y, z + 0.35 * k + 0.002 * y**2])
        wires.append(np.stack([line[:-1], line[1:]], axis=1))
    builder.mesh(
        "wires", "aluminium-rough", bars(np.concatenate(wires), rng.uniform(0.004, 0.015), 6)
    )


def _lamp_posts(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """Add lamp posts or flag poles in a row beside the site."""
    off = parameters.size_m + 2.5
    ground = -parameters.building_m if parameters.place == "roof" else 0.0
    tall = max(4.0, parameters.height_m * rng.uniform(0.7, 1.3)) - ground
    pole = rod((0, 0, -0.3), (0, 0, tall), 0.05, 10)
    head = block((0.25, 1.0, 0.1), (0, 0.4, tall))
    spots = [_turned(parameters, x, way * off) for x in (-6, 2, 10, 18) for way in (-1, 1)]
    spots = [spot for spot in spots if np.hypot(*spot) > 2.5]
    positions = np.array([land.on(*spot) for spot in spots])
    builder.mesh("lamp posts", "steel-galvanised",
               spread(union([pole, head]), positions, parameters.turn_deg, 1))  # fmt: skip


def _fence(
    builder: SceneBuilder,
    parameters: LandingApproachParameters,
    rng: np.random.Generator,
    land: Terrain,
) -> None:
    """Mesh fence on posts around two sides; on a roof, a railing."""
    off = parameters.size_m + (1.7 if parameters.place == "roof" else 2.8)
    s = np.linspace(-off, off, 9)
    flat = [_turned(parameters, t, off) for t in s] + [
        _turned(parameters, off, t) for t in s[-2::-1]
    ]
    feet = np.array(
        [(x, y, 0.0 if parameters.place == "roof" else land.height(x, y)) for x, y in flat]
    )
    tall = 1.1 if parameters.place == "roof" else rng.uniform(1.2, 2.4)
    builder.mesh(
        "fence posts",
        "steel-galvanised",
        spread(rod((0, 0, -0.2), (0, 0, tall), 0.03, 8), feet, 0, 1),
    )
    levels = np.linspace(0.1, tall, int(rng.integers(3, 14)))
    spans = np.stack([feet[:-1], feet[1:]], axis=1)
    runs = np.concatenate([spans + np.array([0, 0, level]) for level in levels])
    builder.mesh("fence wires", "steel-galvanised", bars(runs, 0.006 if tall > 1.1 else 0.02, 5))


_ACROSS: dict[
    str, Callable[[SceneBuilder, LandingApproachParameters, np.random.Generator, Terrain], None]
]
_ACROSS = {"none": _nothing, "power-line": _power_line, "lamp-posts": _lamp_posts, "fence": _fence}

FAMILY = Family(
    "The approach to a pad, a road, a runway or a flat roof, the horizon behind",
    LandingApproachParameters,
    build,
    min_spots=0,
)
