"""A warehouse aisle: racks with goods on both sides, obstacles, an end wall."""

from collections.abc import Callable

import numpy as np

from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts import props
from spisim_worlds.parts.placing import aside
from spisim_worlds.parts.shapes import Mesh, tube

Position = tuple[float, float, float]
Add = Callable[[SceneBuilder, Position, np.random.Generator], None]
#: Heights of a rack's decks, and its width and depth.
DECKS_M, RACK_M, RACK_DEPTH_M = (0.15, 1.0, 1.8), 1.8, 0.6
SKYLIGHT_M = 1.6
#: Radius of a person, including elbows and hands.
WORKER_MAX_RANGE_M = 0.4


class WarehouseParameters(Parameters):
    """The drone flies in the middle of the aisle and looks slightly down."""

    drone_height_m: float = drawn(1.4, 2.0, "above the floor")
    target_m: float = drawn(0.4, 1.1, "height looked at on the end wall")
    length_m: float = drawn(7.5, 9.3, "to the end wall")
    aisle_m: float = drawn(1.7, 2.8, "width between the racks")
    first_rack_m: float = drawn(3.0, 5.0, "to the first racks")
    goods: float = drawn(0.3, 0.95, "fraction of the rack positions that are occupied")
    nearest_m: float = drawn(2.4, 3.4, "to the first thing in the way")
    things: int = drawn(4, 8, "in the way, where there is room")
    lamps: int = drawn(1, 3, "that hang from the ceiling")
    cable_mm: float = drawn_log(4.0, 16.0, "diameter of a loose cable that hangs into the aisle")
    ceiling_m: float = drawn(3.6, 5.0, "height of the hall")
    walls: str = one_of("concrete-weathered", "brick", "metal-roof", text="of the hall")
    worker: str = one_of("worker", "none", text="in the aisle")


def build(parameters: WarehouseParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the aisle along x."""
    eye = (0.0, rng.uniform(-0.15, 0.15), parameters.drone_height_m)
    target = (parameters.length_m, rng.uniform(-0.5, 0.5), parameters.target_m)
    builder = SceneBuilder(eye, target, sky_klx=rng.uniform(5.0, 20.0))
    _hall(builder, parameters)
    _racks(builder, parameters, rng)
    _end(builder, parameters, rng)
    _way(builder, parameters, rng)
    _above(builder, parameters, rng)
    return builder


def _hall(builder: SceneBuilder, parameters: WarehouseParameters) -> None:
    """Floor, walls, and a ceiling with a skylight over the aisle."""
    x, high = parameters.length_m, parameters.ceiling_m
    length, wide = x + 2.0, parameters.aisle_m + 2 * RACK_DEPTH_M + 0.4
    middle = x / 2 - 1.0
    builder.rectangle("floor", "concrete", (length, wide), (middle, 0, 0))
    ends: list[Pose] = [((0, 0, 0), (x, 0, high / 2)), ((0, 0, 180), (-2.0, 0, high / 2))]
    builder.rectangle("end wall", parameters.walls, (high, wide), turn=(0, -90, 0), copies=ends)
    sides: list[Pose] = [
        ((0, 0, 0), (middle, wide / 2, high / 2)),
        ((0, 0, 180), (middle, -wide / 2, high / 2)),
    ]
    builder.rectangle("side wall", parameters.walls, (length, high), turn=(90, 0, 0), copies=sides)
    strip = (wide - SKYLIGHT_M) / 2
    panels: list[Pose] = [
        ((0, 0, 0), (middle, way * (SKYLIGHT_M + strip) / 2, high)) for way in (-1, 1)
    ]
    builder.rectangle("ceiling", "concrete", (length, strip), turn=(180, 0, 0), copies=panels)


def _racks(
    builder: SceneBuilder, parameters: WarehouseParameters, rng: np.random.Generator
) -> None:
    """Racks in line on either side; boxes, drums and wrapped goods on their decks."""
    off = parameters.aisle_m / 2 + RACK_DEPTH_M / 2
    starts = np.arange(parameters.first_rack_m, parameters.length_m - RACK_M, RACK_M + 0.05)
    positions = [(x + RACK_M / 2, side * off) for x in starts for side in (-1, 1)]
    racks: list[Pose] = [((0, 0, 90), (x, y, 0)) for x, y in positions]
    builder.mesh("rack", "steel-painted", props.rack(), copies=racks)
    sizes = [(0.5, 0.4, 0.4), (0.4, 0.45, 0.55), (0.35, 0.4, 0.28)]
    boxes: list[list[Pose]] = [[] for _ in sizes]
    drums: list[Pose] = []
    for x, y in positions:
        for deck in DECKS_M:
            for slot in (-0.58, 0.0, 0.58):
                if rng.random() > parameters.goods:
                    continue
                turn = (0, 0, rng.uniform(-8, 8))
                at = (x + slot + rng.uniform(-0.04, 0.04), y + rng.uniform(-0.06, 0.06))
                kind = int(rng.integers(len(sizes) + 1))
                if kind == len(sizes):
                    drums.append((turn, (*at, deck)))
                else:
                    boxes[kind].append((turn, (*at, deck + sizes[kind][2] / 2)))
    materials = ("cardboard", "wood-dry", "polyethylene-film")
    for name, material, size, copies in zip(
        ("carton", "crate", "wrapped goods"), materials, sizes, boxes, strict=True
    ):
        if copies:
            builder.box(name, material, size, copies=copies)
    if drums:
        small = props.drum().apply_scale(0.75)
        builder.mesh("canister", "steel-galvanised", small, copies=drums)


def _end(builder: SceneBuilder, parameters: WarehouseParameters, rng: np.random.Generator) -> None:
    """Add objects that lean on or stand at the end wall."""
    x = parameters.length_m
    y = rng.uniform(-0.3, 0.3) * parameters.aisle_m
    builder.mesh("ladder", "aluminium-anodised", props.ladder(), (x - 0.66, y, 0.01), (0, 15, 0))
    bottles: list[Pose] = [
        ((0, 0, 0), (x - 0.25, -np.sign(y) * (0.35 + 0.28 * k), 0)) for k in range(2)
    ]
    builder.mesh("gas bottle", "steel-painted", props.gas_cylinder(), copies=bottles)


def _way(builder: SceneBuilder, parameters: WarehouseParameters, rng: np.random.Generator) -> None:
    """Add obstacles in the aisle, alternately left and right, each in view, if there is room."""
    ahead = np.linspace(parameters.nearest_m, parameters.length_m - 2.0, parameters.things)
    kinds = rng.permutation(sorted(_THINGS))[: parameters.things]
    side = rng.choice([-1, 1])
    taken: list[tuple[float, float, float]] = []
    for n, (name, x) in enumerate(zip(kinds, ahead, strict=True)):
        reach, add = _THINGS[str(name)]
        widest = parameters.aisle_m / 2 - reach
        y = (-1) ** n * side * min(aside(float(x), rng.uniform(3.0, 9.0)), widest)
        if _is_free(taken, float(x), float(y), reach):
            taken.append((float(x), float(y), reach))
            add(builder, (float(x), float(y), 0.0), rng)
    if parameters.worker == "worker":
        _worker(builder, parameters, taken, rng)


def _worker(
    builder: SceneBuilder,
    parameters: WarehouseParameters,
    taken: list[tuple[float, float, float]],
    rng: np.random.Generator,
) -> None:
    """Add a person at the first free position of several, if any."""
    turn = (0, 0, rng.uniform(-40, 40))
    widest = parameters.aisle_m / 2 - WORKER_MAX_RANGE_M
    for x, across in rng.uniform((4.5, -1.0), (7.0, 1.0), (50, 2)).tolist():
        y = across * min(aside(x, 6.0), widest)
        if _is_free(taken, x, y, WORKER_MAX_RANGE_M):
            props.add_worker(builder, (x, y, 0), turn)
            return


def _is_free(taken: list[tuple[float, float, float]], x: float, y: float, reach: float) -> bool:
    """Return whether an object of some reach stays clear of all others (x, y, reach)."""
    return all(np.hypot(x - x_, y - y_) >= reach + reach_ for x_, y_, reach_ in taken)


def _above(
    builder: SceneBuilder, parameters: WarehouseParameters, rng: np.random.Generator
) -> None:
    """Add lamps, and a loose cable down to about the height of the drone."""
    rim = parameters.ceiling_m - 1.75
    spots = np.linspace(3.5, parameters.length_m - 1.5, parameters.lamps)
    lamps: list[Pose] = [((0, 0, 0), (float(x), 0, rim)) for x in spots]
    builder.mesh("lamp", "paint-white", props.lamp(), copies=lamps)
    x = rng.uniform(1.8, 3.2)
    end = builder.position_m[2] - aside(x, rng.uniform(2.0, 8.0))
    y = builder.position_m[1] + aside(x, rng.uniform(-7.0, 7.0))
    line = [(x, y, parameters.ceiling_m), (x + 0.03, y + 0.05, 0.5 * (end + parameters.ceiling_m)),
            (x, y - 0.03, end + 0.3), (x - 0.04, y + 0.02, end)]  # fmt: skip
    builder.mesh("hanging cable", "rubber-black", tube(line, parameters.cable_mm / 2000, 6))
    bars: list[Pose] = [((0, 0, 0), (float(x), 0, parameters.ceiling_m)) for x in (*spots, x)]
    builder.box("skylight bar", "steel-painted", (0.06, SKYLIGHT_M, 0.1), copies=bars)


def _drum_on_pallets(builder: SceneBuilder, at: Position, rng: np.random.Generator) -> None:
    count = int(rng.integers(1, 5))
    pallets: list[Pose] = [
        ((0, 0, 90 + rng.uniform(-4, 4)), (at[0], at[1], 0.144 * k)) for k in range(count)
    ]
    builder.mesh("pallet below the drum", "wood-weathered", props.pallet(), copies=pallets)
    builder.mesh("drum", "steel-rusty", props.drum(), (at[0], at[1], 0.144 * count))


def _cartons_on_a_pallet(builder: SceneBuilder, at: Position, rng: np.random.Generator) -> None:
    builder.mesh("pallet below the cartons", "wood-weathered", props.pallet(), at, (0, 0, 90))
    copies: list[Pose] = []
    layers = int(rng.integers(1, 4))
    for layer in range(layers):
        for dx, dy in ((-0.2, -0.3), (-0.2, 0.3), (0.2, -0.3), (0.2, 0.3)):
            position = (at[0] + dx, at[1] + 0.85 * dy, 0.144 + 0.32 * (layer + 0.5))
            copies.append(((0, 0, rng.uniform(-7, 7)), position))
    builder.box("stacked carton", "cardboard", (0.36, 0.46, 0.32), copies=copies)
    top = (at[0] - 0.15, at[1], 0.144 + 0.32 * layers)
    builder.mesh("open carton", "cardboard", props.open_carton(), top, (0, 0, rng.uniform(-20, 20)))


def _tyres(builder: SceneBuilder, at: Position, rng: np.random.Generator) -> None:
    copies: list[Pose] = [
        ((0, 0, 0), (at[0] + rng.uniform(-0.03, 0.03), at[1] + rng.uniform(-0.03, 0.03), 0.2 * k))
        for k in range(int(rng.integers(2, 6)))
    ]
    builder.mesh("tyre", "rubber-black", props.tyre(), copies=copies)


def _pallet_truck(builder: SceneBuilder, at: Position, rng: np.random.Generator) -> None:
    """Add it along the aisle, with forks over the position, towards the drone or away."""
    turn = float(rng.choice((0, 180)) + rng.uniform(-8, 8))
    back = 0.4 * np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn)), 0])
    builder.mesh("pallet truck", "steel-painted", props.pallet_jack(), at - back, (0, 0, turn))


def _single(name: str, material: str, make: Callable[[], Mesh]) -> Add:
    """One prop, turned at random."""

    def add(builder: SceneBuilder, at: Position, rng: np.random.Generator) -> None:
        builder.mesh(name, material, make(), at, (0, 0, rng.uniform(0, 360)))

    return add


#: Reach of each obstacle around its position on the floor, and the function that adds it.
_THINGS: dict[str, tuple[float, Add]] = {
    "drum on pallets": (0.75, _drum_on_pallets),
    "cartons on a pallet": (0.75, _cartons_on_a_pallet),
    "tyres": (0.36, _tyres),
    "pallet truck": (0.85, _pallet_truck),
    "cone": (0.3, _single("cone", "pvc", props.cone)),
    "gas bottle in the way": (
        0.12,
        _single("gas bottle in the way", "steel-galvanised", props.gas_cylinder),
    ),
    "carton on the floor": (0.46, _single("carton on the floor", "cardboard", props.open_carton)),
    "step ladder": (0.57, _single("step ladder", "aluminium-anodised", props.step_ladder)),
}

FAMILY = Family(
    "A warehouse aisle: racks with goods, things in the way, a hanging cable",
    WarehouseParameters,
    build,
)
