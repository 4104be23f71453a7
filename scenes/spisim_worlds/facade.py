"""The front of a house from the air: windows, balconies, trees; the sky above or beside it."""

from collections.abc import Callable

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.facade import ROOM_M, STOREY_M, WALL_M, Front, add_front
from spisim_worlds.parts.houses import ROOFS, WALLS, add_houses
from spisim_worlds.parts.plants import blades
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import (
    bars,
    block,
    lathe,
    prism,
    rod,
    sheet,
    spread,
    tube,
    union,
)  # fmt: skip
from spisim_worlds.parts.terrain import Terrain, hills, patchwork, terrain, waves
from spisim_worlds.parts.vehicles import add_car, add_van
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view

#: Depth of the house behind its front rooms.
DEEP_M = 7.0


class FacadeParameters(Parameters):
    """The front is square to the y axis; the drone flies before it, or over its eaves."""

    distance_m: float = drawn_log(2.2, 14.0, "to the front, square to it")
    heading_deg: float = drawn(-65.0, 65.0, "of the line of sight from square to the front")
    pitch_deg: float = drawn(-14.0, 14.0, "of the line of sight, down is positive")
    height: float = drawn(0.12, 1.25, "of the drone, relative to the eaves")
    storeys: int = drawn(1, 6, "of the house")
    end_deg: float = drawn(-22.0, 22.0, "at which the front ends, from the line of sight")
    end: str = one_of("left", "right", text="which end is near the line of sight")
    bay_m: float = drawn(1.9, 4.0, "distance of the windows")
    window_m: float = drawn(0.7, 1.7, "width of the windows")
    window_high_m: float = drawn(0.8, 1.9, "height of the windows")
    wall: str = one_of(*WALLS, text="of the house front")
    frame: str = one_of("paint-white", "wood-dry", "pvc", "aluminium-anodised", text="of windows")
    roof: str = one_of("flat", "gable", text="of the house")
    balconies: str = one_of("none", "bars", "solid", "glass", text="before some windows")
    balcony_share: float = drawn(0.15, 1.0, "of windows that have a balcony, where there are any")
    shutters: str = one_of("none", "open", text="beside the windows")
    ivy: float = drawn(0.0, 0.6, "fraction of the front that it may cover, if there is any")
    trees: int = drawn(0, 3, "before the front")
    tree_m: float = drawn(4.0, 14.0, "height of these")
    wire: str = one_of("none", "cable", "laundry", text="before the front")
    hills_m: float = drawn(0.0, 400.0, "height of the hills beyond")


def build(parameters: FacadeParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the drone over the origin and the front `distance_m` along y."""
    eaves = parameters.storeys * STOREY_M
    view = 90.0 - parameters.heading_deg
    rolling, far = waves(rng, (20, 80)), hills(rng, rng.uniform(250, 800), parameters.hills_m)

    def relief(x: Floats, y: Floats) -> Floats:
        away = np.clip((np.hypot(x, y) - 60) / 60, 0, 1)
        return -0.02 + 1.5 * away * rolling(x, y) + far(x, y)

    land = terrain(relief, ((-30, 30), (-5, 35)), 1.5)
    eye = np.array([0.0, 0.0, max(1.2, parameters.height * eaves)])
    forward = np.radians(view)
    down = np.tan(np.radians(parameters.pitch_deg))
    aim = eye + 10 * np.array([np.cos(forward), np.sin(forward), -down])
    builder = SceneBuilder(tuple(eye), tuple(aim), **outdoors(rng))
    land.add(builder, ["asphalt", "grass", "gravel"], patchwork(rng, land, 3, 6.0))
    front = _front(parameters, rng)
    y = parameters.distance_m
    add_front(builder, front, y, parameters.wall, parameters.frame, rng)
    _body(builder, parameters, rng, front)
    _on_the_front(builder, parameters, rng, front)
    _before(builder, parameters, rng, front, land, view)
    houses = in_view(rng, land, int(rng.integers(0, 5)), 60, 250, 14, view)
    behind = houses[:, 1] > y + DEEP_M + 20
    add_houses(builder, rng, [tuple(position) for position in houses[behind]])
    add_far_woods(builder, rng, land, int(rng.integers(2, 8)), 120.0, view)
    return builder


def _front(parameters: FacadeParameters, rng: np.random.Generator) -> Front:
    """Build the front, which ends where the parameters say and extends the other way."""
    at = np.clip(parameters.heading_deg + parameters.end_deg, -78, 78)
    corner = float(parameters.distance_m * np.tan(np.radians(at)))
    width = min(parameters.window_m, parameters.bay_m - 0.5)
    bays = int(rng.integers(3, 9)) + int(12 / parameters.bay_m)
    start = corner if parameters.end == "left" else corner - bays * parameters.bay_m
    high = parameters.window_high_m
    sill = rng.uniform(0.3, min(1.0, STOREY_M - high - 0.3))
    doors = tuple(sorted({int(k) for k in rng.integers(0, bays, 2)}))
    sill = max(sill, 2.3 - high)  # a window's head is above the doors'
    return Front(start, bays, parameters.storeys, parameters.bay_m, (width, high), sill, doors)


def _body(
    builder: SceneBuilder, parameters: FacadeParameters, rng: np.random.Generator, front: Front
) -> None:
    """Gable walls, the rest of the house, the roof with its gutter and chimneys."""
    length = front.bays * front.bay_m
    eaves = front.storeys * STOREY_M
    middle, y = front.start_m + length / 2, parameters.distance_m
    behind = y + WALL_M + ROOM_M + 0.1
    whole = behind + DEEP_M - y
    walls = [
        block((0.25, whole, eaves), (middle + way * (length / 2 + 0.12), y + whole / 2, eaves / 2))
        for way in (-1, 1)
    ]
    walls.append(block((length, DEEP_M, eaves), (middle, behind + DEEP_M / 2, eaves / 2)))
    roof = str(rng.choice(ROOFS))
    ridge_y = y + whole / 2
    if parameters.roof == "gable":
        rise = whole / 2 * np.tan(np.radians(rng.uniform(18, 48)))
        half, over = whole / 2, 0.5
        drop = over * rise / half
        attic = prism([(-half, eaves), (half, eaves), (0, eaves + rise)], length)
        slopes = [
            prism([(-half - over, eaves - drop), (0, eaves + rise), (0, eaves + rise + 0.2),
                   (-half - over, eaves - drop + 0.2)], length + 0.8),
            prism([(0, eaves + rise), (half + over, eaves - drop),
                   (half + over, eaves - drop + 0.2), (0, eaves + rise + 0.2)], length + 0.8),
        ]  # fmt: skip
        turn = (0.0, 0.0, 90.0)
        builder.mesh("attic", parameters.wall, attic, (middle, ridge_y, 0.0), turn)
        builder.mesh("roof", roof, union(slopes), (middle, ridge_y, 0.1), turn)
        gutter = rod((-length / 2, 0, 0), (length / 2, 0, 0), 0.08, 8)
        builder.mesh("gutter", "steel-galvanised", gutter, (middle, y - over, eaves - drop + 0.1))
        top = eaves + 0.6 * rise
    else:
        high = rng.uniform(0.1, 1.0)
        slab = block((length + 0.5, whole + 0.4, 0.2), (middle, ridge_y, eaves + 0.15))
        rim = block((length + 0.5, 0.25, high), (middle, y + 0.1, eaves + 0.2 + high / 2))
        builder.mesh("roof", "roofing-felt", slab)
        builder.mesh("parapet", parameters.wall, rim)
        top = eaves
    n = int(rng.integers(0, 4))
    if n:
        x = front.start_m + length * rng.uniform(0.02, 0.98, n)
        positions = np.column_stack(
            [x, ridge_y + rng.uniform(-0.4, 0.1, n) * whole, np.full(n, top)]
        )
        stack = union([block((0.6, 0.9, 2.4), (0, 0, 1.0)), block((0.75, 1.05, 0.15), (0, 0, 2.2))])
        builder.mesh("chimneys", "brick", spread(stack, positions, 0, 1))
    if rng.random() < 0.4:
        mast = [[(0, 0, 0), (0, 0, 3.5)], *([(-0.5, 0, z), (0.5, 0, z)] for z in (2.6, 3.0, 3.4))]
        at = (front.start_m + length * rng.random(), ridge_y - 0.3 * whole, top - 0.5)
        builder.mesh("aerial", "aluminium-anodised", bars(mast, 0.02, 6), at)
    builder.mesh("house", parameters.wall, union(walls))


def _on_the_front(
    builder: SceneBuilder, parameters: FacadeParameters, rng: np.random.Generator, front: Front
) -> None:
    """Balconies, shutters, air conditioners, dishes, downpipes and ivy."""
    y = parameters.distance_m
    windows = np.array(front.windows())
    width, height = front.window_m
    positions = np.column_stack([windows[:, 0], np.full(len(windows), y), windows[:, 1]])
    upper = positions[windows[:, 1] > STOREY_M]
    if parameters.balconies != "none" and len(upper):
        chosen = upper[rng.random(len(upper)) < parameters.balcony_share]
        wide = min(front.bay_m - 0.3, width + 1.0)
        if len(chosen):
            feet = chosen - (0, 0, height / 2 + 0.2)
            _balconies(builder, parameters, rng, wide, feet)
    if parameters.shutters == "open" and 1.9 * width < front.bay_m:
        leaf = block((0.4 * width, 0.04, height), (0, -0.04, 0))
        pair = union([leaf.copy().apply_translation((s * 0.72 * width, 0, 0)) for s in (-1, 1)])
        builder.mesh("shutters", "wood-dry", spread(pair, positions, 0, 1))
    picked = positions[rng.random(len(positions)) < 0.12]
    if len(picked):
        low = -height / 2 - 0.45
        fan = rod((0, -0.46, low), (0, -0.42, low), 0.24, 14)
        unit = union([block((0.8, 0.35, 0.6), (0, -0.25, low)), fan])
        builder.mesh("air conditioners", "steel-painted", spread(unit, picked, 0, 1))
    picked = positions[rng.random(len(positions)) < 0.1]
    if len(picked):
        dish = lathe([(0, 0), (0.2, 0.02), (0.36, 0.09), (0.4, 0.13), (0.36, 0.11), (0, 0.03)], 18)
        dish.apply_transform(_TILT)
        dish.apply_translation((0.5 * width + 0.45, -0.35, 0))
        builder.mesh("dishes", "steel-painted", spread(dish, picked, 0, 1))
    pipes = np.arange(0, front.bays + 1, int(rng.integers(2, 5))) * front.bay_m + front.start_m
    top = front.storeys * STOREY_M
    builder.mesh("downpipes", "steel-galvanised",
               bars([[(x, y - 0.09, 0), (x, y - 0.09, top)] for x in pipes], 0.05, 8))  # fmt: skip
    if rng.random() < 0.35 and parameters.ivy > 0.05:
        n = int(6000 * parameters.ivy)
        centre = front.start_m + front.bays * front.bay_m * rng.random()
        z = top * rng.random(n) ** 1.3
        x = centre + rng.normal(0, 2.5, n) * (1.2 - z / top)
        ends = front.start_m, front.start_m + front.bays * front.bay_m
        within = (x > ends[0]) & (x < ends[1])
        leaf = np.column_stack([x, y - rng.uniform(0.02, 0.15, n), z])[within]
        out = np.tile((0.0, -1.0, -0.3), (len(leaf), 1))
        builder.mesh("ivy", "leaves-green", blades(rng, leaf, out, 0.13))


def _balconies(
    builder: SceneBuilder,
    parameters: FacadeParameters,
    rng: np.random.Generator,
    wide: float,
    feet: Floats,
) -> None:
    """Slabs with railings of bars, of panels or of glass, and what stands on them."""
    deep, high = rng.uniform(0.8, 1.6), rng.uniform(0.9, 1.1)
    builder.mesh("balconies", "concrete",
               spread(block((wide, deep, 0.16), (0, -deep / 2, -0.08)), feet, 0, 1))  # fmt: skip
    half = wide / 2 - 0.04
    corners = [(-half, 0.0), (-half, 0.05 - deep), (half, 0.05 - deep), (half, 0.0)]
    rail = tube([(x, y, high) for x, y in corners], 0.025, 6)
    if parameters.balconies == "bars":
        gap = rng.uniform(0.09, 0.14)
        posts = [(x, 0.05 - deep) for x in np.arange(-half, half, gap)]
        posts += [(s * half, -y) for s in (-1, 1) for y in np.arange(0.1, deep - 0.05, gap)]
        upright = bars([[(x, y, 0), (x, y, high)] for x, y in posts], 0.008, 5)
        builder.mesh("railings", "steel-painted", spread(union([rail, upright]), feet, 0, 1))
    else:
        builder.mesh("railings", "steel-painted", spread(rail, feet, 0, 1))
        panels = [block((wide, 0.05, high - 0.2), (0, 0.05 - deep, high / 2))]
        panels += [
            block((0.05, deep, high - 0.2), (s * half, -deep / 2, high / 2)) for s in (-1, 1)
        ]
        if parameters.balconies == "glass":
            flat = [np.array([(-half, 0.05 - deep), (half, 0.05 - deep)])]
            flat += [np.array([(s * half, 0), (s * half, 0.05 - deep)]) for s in (-1, 1)]
            panels = [sheet([(*a, 0.1), (*b, 0.1), (*b, high), (*a, high)]) for a, b in flat]
        material = "glass-pane" if parameters.balconies == "glass" else "fibreglass"
        builder.mesh("panels", material, spread(union(panels), feet, 0, 1))
    used = feet[rng.random(len(feet)) < 0.5]
    if len(used):
        pot = lathe([(0, 0), (0.16, 0), (0.22, 0.35), (0, 0.3)], 12)
        seat = [block((0.45, 0.45, 0.05), (0.7, -0.5, 0.45))]
        seat.append(block((0.45, 0.05, 0.5), (0.7, -0.28, 0.7)))
        legs = [(0.7 + a, -0.5 + b, 0.22) for a in (-0.2, 0.2) for b in (-0.2, 0.2)]
        chair = union([*seat, *(block((0.04, 0.04, 0.45), leg) for leg in legs)])
        builder.mesh("chairs", "polypropylene", spread(chair, used, 0, min(1.0, wide / 2)))
        plant = np.array([-0.3 * wide, -0.5 * deep, 0])
        builder.mesh("pots", "brick", spread(pot, used + plant, 0, 1))
        n = 90
        leaf = blades(rng, rng.normal((0, 0, 0.5), 0.1, (n, 3)), rng.normal(size=(n, 3)), 0.12)
        builder.mesh("plants", "leaves-green", spread(leaf, used + plant, 0, 1))


def _before(
    builder: SceneBuilder, parameters: FacadeParameters, rng: np.random.Generator, front: Front,
    land: Terrain, view_deg: float,
) -> None:  # fmt: skip
    """Trees, a parked car, and a cable or laundry between the drone and the front."""
    y = parameters.distance_m
    spots = []
    for _ in range(parameters.trees):
        distance, angle = rng.uniform(0.35, 0.9), np.radians(view_deg + rng.uniform(-16, 16))
        reach = distance * y / max(0.15, np.sin(angle))
        x, ahead = reach * np.cos(angle), reach * np.sin(angle)
        if 3.0 < reach < 40 and ahead < y - 0.5:
            spots.append(land.on(x, ahead, 0.05))
    kind = str(rng.choice(sorted(TREES)))
    tall = max(parameters.tree_m, 1.1 * float(builder.position_m[2]))
    add_wood(builder, "tree", (kind,), "leaves-green", rng, spots, min(tall, 16.0))
    x = y * np.tan(np.radians(parameters.heading_deg + rng.uniform(-12, 12)))
    if rng.random() < 0.5 and y > 5:
        add = add_car if rng.random() < 0.5 else add_van
        add(builder, (x, y - 2.2, 0.0), (0, 0, float(rng.choice([0, 180]))))
    _WIRES[parameters.wire](builder, parameters, rng)
    lamp = [((0, 0, 0), (x + 6 * k, y - 3.0, 0.0)) for k in (-1, 0, 1) if y > 6]
    if lamp and rng.random() < 0.6:
        tall = rng.uniform(4, 9)
        post = union(
            [rod((0, 0, 0), (0, 0, tall), 0.06, 10), block((0.2, 1.2, 0.1), (0, -0.5, tall))]
        )
        copies: list[Pose] = lamp  # type: ignore[assignment]
        builder.mesh("lamp post", "steel-galvanised", post, copies=copies)


def _no_wire(builder: SceneBuilder, parameters: FacadeParameters, rng: np.random.Generator) -> None:
    """Add nothing."""


def _cable(builder: SceneBuilder, parameters: FacadeParameters, rng: np.random.Generator) -> None:
    """Cables to the house, or along it, across the view."""
    y, z = parameters.distance_m, float(builder.position_m[2])
    for number in range(int(rng.integers(1, 4))):
        ahead = y * rng.uniform(0.3, 0.9)
        middle = ahead * np.tan(np.radians(parameters.heading_deg + rng.uniform(-8, 8)))
        down = np.hypot(ahead, middle) * np.tan(
            np.radians(parameters.pitch_deg + rng.uniform(-8, 8))
        )
        slope = rng.uniform(-0.25, 0.25)
        ends = [(middle + s * 14, ahead + s * 14 * slope, z - down + 0.6) for s in (-1, 1)]
        path = hanging(ends[0], ends[1], 0.6, 41)
        builder.mesh(f"cable {number + 1}", "rubber-black", tube(path, rng.uniform(0.003, 0.02), 6))


def _laundry(builder: SceneBuilder, parameters: FacadeParameters, rng: np.random.Generator) -> None:
    """A line with cloths on it."""
    y, z = parameters.distance_m, float(builder.position_m[2])
    ahead = y * rng.uniform(0.55, 0.9)
    middle = ahead * np.tan(np.radians(parameters.heading_deg + rng.uniform(-8, 8)))
    down = np.hypot(ahead, middle) * np.tan(np.radians(parameters.pitch_deg + rng.uniform(-6, 6)))
    line = [[(middle - 8, ahead, z - down), (middle + 8, ahead, z - down)]]
    builder.mesh("line", "nylon-fabric", bars(line, 0.004, 5))
    cloths = []
    at = middle - 5.0
    while at < middle + 5:
        wide, tall = rng.uniform(0.3, 1.2), rng.uniform(0.3, 1.3)
        top, foot = z - down, z - down - tall
        edge = [(at, ahead, top), (at + wide, ahead, top)]
        hem = [(at + wide, ahead + 0.06, foot), (at, ahead - 0.05, foot)]
        cloths.append(sheet([*edge, *hem]))
        at += wide + rng.uniform(0.05, 0.8)
    builder.mesh("laundry", "cotton-white", union(cloths))


#: Rotates a dish from facing up to facing out of the front.
_TILT = np.array(
    [[1, 0, 0, 0], [0, 0.5, -np.sqrt(0.75), 0], [0, np.sqrt(0.75), 0.5, 0], [0, 0, 0, 1.0]]
)
_WIRES: dict[str, Callable[[SceneBuilder, FacadeParameters, np.random.Generator], None]] = {
    "none": _no_wire,
    "cable": _cable,
    "laundry": _laundry,
}

FAMILY = Family(
    "The front of a house with balconies, windows and trees, the sky above or beside it",
    FacadeParameters,
    build,
    min_spots=0,
)
