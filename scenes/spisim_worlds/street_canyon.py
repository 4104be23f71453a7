"""A street between houses: windows, doors, a parked car, a lamp post, a cable over the street."""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.facade import DOOR_M, Front, add_front
from spisim_worlds.parts.houses import add_houses
from spisim_worlds.parts.placing import aside
from spisim_worlds.parts.props import add_worker, lamp
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import Mesh, block, lathe, prism, rod, strip, tube, union
from spisim_worlds.parts.terrain import hills, patchwork, terrain, waves
from spisim_worlds.parts.vehicles import add_car, add_van
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view

PAVEMENT_M, KERB_M = 1.5, 0.12


class StreetParameters(Parameters):
    """The drone flies in the street and looks at the houses on its left at an angle."""

    drone_height_m: float = drawn(1.7, 2.7, "above the road")
    front_m: float = drawn(4.8, 6.0, "from the drone to the house front, square to it")
    heading_deg: float = drawn(40.0, 65.0, "of the line of sight to the street")
    target_m: float = drawn(1.1, 2.0, "height looked at on the house front")
    bay_m: float = drawn(1.9, 2.8, "distance of the windows")
    window_m: float = drawn(1.0, 1.5, "width of the windows")
    storeys: int = drawn(2, 4, "of the houses")
    wall: str = one_of("brick", "plasterboard", "concrete-weathered", text="of the house front")
    frame: str = one_of("paint-white", "wood-dry", "pvc", text="of windows")
    vehicle: str = one_of("car", "van", "none", text="parked at the kerb")
    cable_mm: float = drawn_log(4.0, 16.0, "diameter of the cable over the street")
    cable_m: float = drawn(2.2, 3.8, "to that cable")
    awning: str = one_of("awning", "none", text="above a ground-floor window")
    clutter: int = drawn(2, 7, "bins and bollards on the pavement")
    passer_by: str = one_of("walker", "none", text="on the pavement")
    view: str = one_of(
        "front", "along", "above", text="of a front, along the street, or to the roofs"
    )
    rise: float = drawn(0.0, 1.0, "of the way to the eaves the drone flies, if not before a front")
    turn_deg: float = drawn(-36.0, 8.0, "of the line of sight to the street, if not to a front")
    tilt_deg: float = drawn(
        -10.0, 10.0, "of the line of sight, down is positive, if not to a front"
    )


def build(parameters: StreetParameters, rng: np.random.Generator) -> SceneBuilder:
    """The street runs along x; the line of sight turns from it to the left."""
    y = parameters.front_m
    if parameters.view != "front":
        # The random draws of a front are unchanged; another part of it is in view.
        parameters = _further(parameters)
    eye_z = parameters.drone_height_m
    target = (y / np.tan(np.radians(parameters.heading_deg)), y, parameters.target_m)
    builder = SceneBuilder((0.0, 0.0, eye_z), target, **outdoors(rng))
    front = _front(parameters, rng)
    add_front(builder, front, y, parameters.wall, parameters.frame, rng)
    _street(builder, parameters)
    _vehicle(builder, parameters, rng)
    _pavement(builder, parameters, rng)
    _on_the_wall(builder, parameters, rng, front)
    _over_the_street(builder, parameters, rng)
    if parameters.view != "front":
        _open_end(builder, parameters, rng)
    return builder


def _further(parameters: StreetParameters) -> StreetParameters:
    """Show the same street past its end, or from the height of the eaves or above."""
    low, eaves = parameters.drone_height_m, 3.0 * parameters.storeys
    height = low + parameters.rise * (eaves + 0.5 - low)
    heading = parameters.heading_deg + parameters.turn_deg
    level = eaves
    if parameters.view == "along":
        heading, level = 12.0 + 0.7 * (parameters.heading_deg - 40.0), height
    away = parameters.front_m / np.sin(np.radians(heading))
    target = level - away * np.tan(np.radians(parameters.tilt_deg))
    changed = {"heading_deg": heading, "drone_height_m": height, "target_m": target}
    return parameters.model_copy(update=changed)


def _open_end(
    builder: SceneBuilder, parameters: StreetParameters, rng: np.random.Generator
) -> None:
    """Add land to the horizon beyond the houses, with roofs, trees and a row of lamps."""
    heading = parameters.heading_deg
    rolling, far = waves(rng, (40, 200)), hills(rng, rng.uniform(200, 900), rng.uniform(0, 300))

    def relief(x: Floats, y: Floats) -> Floats:
        away = np.clip((np.hypot(x, y) - 30) / 60, 0, 1)
        return far(x, y) - 0.05 - 0.5 * away * (1 - rolling(x, y))

    land = terrain(relief, ((-20, 60), (-30, 30)), 2.0)
    land.add(builder, ["asphalt", "grass", "gravel"], patchwork(rng, land, 3, 8.0), "land")
    top, y = 3.0 * parameters.storeys, parameters.front_m
    pitch = np.tan(np.radians(rng.uniform(20, 45)))
    slope = prism([(0, 0), (4.5, 4.5 * pitch), (4.5, 4.5 * pitch + 0.2), (0, 0.2)], 30.0)
    builder.mesh("roof", "roof-tile-concrete", slope, (5.0, y - 0.4, top + 0.1), (0, 0, 90))
    positions = in_view(rng, land, int(rng.integers(0, 5)), 35, 120, 8, 0.0)
    add_houses(
        builder,
        rng,
        [tuple(position) for position in positions if abs(position[1]) > 14 or position[0] > 45],
    )
    spots = in_view(rng, land, 6, 24, 90, 16, 0.0)
    kinds = [str(kind) for kind in rng.permutation(sorted(TREES))[:2]]
    add_wood(
        builder, "tree", kinds, "leaves-green", rng, spots[spots[:, 1] < y - 1], rng.uniform(5, 12)
    )
    add_far_woods(builder, rng, land, int(rng.integers(2, 7)), 120.0, min(heading, 30.0))


def _in_view(parameters: StreetParameters, before_m: float, angle_deg: float) -> float:
    """Return x of an object before the house front that is seen at an angle to the left."""
    heading = np.radians(parameters.heading_deg + angle_deg)
    return float((parameters.front_m - before_m) / np.tan(heading))


def _front(parameters: StreetParameters, rng: np.random.Generator) -> Front:
    bays = int(np.ceil(26 / parameters.bay_m))
    start = -8 - parameters.bay_m * rng.random()
    window = (parameters.window_m, rng.uniform(1.2, 1.6))
    first = int((_in_view(parameters, 0.0, rng.uniform(-14, 10)) - start) / parameters.bay_m)
    return Front(
        start, bays, parameters.storeys, parameters.bay_m, window, 0.85, (first, first + 4)
    )


def _street(builder: SceneBuilder, parameters: StreetParameters) -> None:
    """Road, pavement and the houses opposite, which shade the sky."""
    y = parameters.front_m
    builder.rectangle("road", "asphalt", (30, 16), (5, 0, 0))
    curb = y - PAVEMENT_M
    builder.box("pavement", "concrete", (30, PAVEMENT_M, KERB_M), (5, curb + PAVEMENT_M / 2, 0.06))
    builder.box("kerb", "concrete-weathered", (30, 0.14, 0.13), (5, curb - 0.07, 0.065))
    dashes: list[Pose] = [((0, 0, 0), (x, 0.3, 0.004)) for x in range(-6, 18, 3)]
    builder.rectangle("road marking", "paint-road-marking", (1.5, 0.12), copies=dashes)
    height = 3.0 * parameters.storeys
    builder.box("houses opposite", "brick", (30, 0.3, height), (5, -4.0, height / 2))


def _vehicle(builder: SceneBuilder, parameters: StreetParameters, rng: np.random.Generator) -> None:
    before = PAVEMENT_M + 1.1
    position = (
        _in_view(parameters, before, rng.uniform(-14, -4)) + 1.2,
        parameters.front_m - before,
        0.0,
    )
    turn = (0, 0, rng.choice([0.0, 180.0]))
    if parameters.vehicle == "car":
        add_car(builder, position, turn)
    elif parameters.vehicle == "van":
        add_van(builder, position, turn)


def _pavement(
    builder: SceneBuilder, parameters: StreetParameters, rng: np.random.Generator
) -> None:
    """Add a lamp post, bins, bollards and a pedestrian."""
    y = parameters.front_m
    post = (_in_view(parameters, 1.2, rng.choice([-1, 1]) * rng.uniform(3, 8)), y - 1.2, KERB_M)
    builder.mesh("lamp post", "steel-galvanised", _lamp_post(), post)
    spots = rng.permutation(np.linspace(-11, 11, parameters.clutter))
    bins: list[Pose] = []
    bollards: list[Pose] = []
    for n, angle in enumerate(spots):
        turn = (0, 0, rng.uniform(-20, 20))
        before = 0.45 if n % 2 == 0 else 1.35
        x = _in_view(parameters, before, angle)
        (bins if n % 2 == 0 else bollards).append((turn, (x, y - before, KERB_M)))
    builder.mesh("bin", "polypropylene", _bin(), copies=bins)
    if bollards:
        builder.mesh("bollard", "steel-painted", _bollard(), copies=bollards)
    if parameters.passer_by == "walker":
        at = (_in_view(parameters, 0.85, rng.uniform(-7, 7)), y - 0.85, KERB_M)
        turn = (0, 0, rng.choice([0.0, 180.0]))
        add_worker(builder, at, turn, "cotton-white", "polyester-fabric")


def _on_the_wall(
    builder: SceneBuilder, parameters: StreetParameters, rng: np.random.Generator, front: Front
) -> None:
    """Down-pipe, awning, a sign on a bracket, a balcony above the door."""
    y = parameters.front_m
    half_pier = front.bay_m / 2
    door = front.middle(front.door_bays[0])
    pipe = np.array([(0, -0.08, 0.15), (0, -0.08, 2.9), (0, -0.14, 3.0), (0, -0.14, 5.7)])
    builder.mesh("down-pipe", "steel-galvanised", tube(pipe, 0.045, 10), (door - half_pier, y, 0))
    if parameters.awning == "awning":
        at = (door + front.bay_m, y, 2.35)
        builder.mesh("awning", "polyester-fabric", _awning(front.bay_m), at)
        builder.mesh("awning arms", "aluminium-anodised", _awning_arms(front.bay_m), at)
    builder.mesh("sign", "paint-white", _sign(rng), (door + half_pier, y, 2.25))
    builder.mesh("balcony", "concrete", block((1.8, 0.9, 0.14), (0, -0.45, 0)), (door, y, 3.0))
    builder.mesh("balcony railing", "steel-painted", _railing(), (door, y, 3.07))
    lantern = block((0.14, 0.18, 0.24), (DOOR_M[0] / 2 + 0.12, -0.09, 2.0))
    builder.mesh("wall lamp", "aluminium-rough", lantern, (door, y, 0))


def _over_the_street(
    builder: SceneBuilder, parameters: StreetParameters, rng: np.random.Generator
) -> None:
    """Cable from house to house through the view, and a lamp on a rope."""
    heading = np.radians(parameters.heading_deg)
    forward = np.array([np.cos(heading), np.sin(heading), 0])
    left = np.array([-forward[1], forward[0], 0])
    eye = np.array(builder.position_m)
    down = (parameters.target_m - eye[2]) * np.sin(heading) / parameters.front_m
    ahead = parameters.cable_m
    rise = down + aside(1.0, rng.uniform(-5.0, 8.0))
    middle = eye + ahead * np.array([forward[0], forward[1], rise])
    ends = middle + 4.5 * np.outer((-1, 1), left) + ((0, 0, 0.5), (0, 0, 0.9))
    cable = hanging(ends[0], ends[1], 0.7, 41)
    builder.mesh("cable", "rubber-black", tube(cable, parameters.cable_mm / 2000, 6))
    x = _in_view(parameters, 1.9, rng.uniform(-6, 6))
    hung = (x, parameters.front_m - 1.9, rng.uniform(2.3, 3.0))
    builder.mesh("hanging lamp", "paint-white", lamp(), hung)
    rope = hanging((x, -4.0, hung[2] + 2.3), (x, parameters.front_m, hung[2] + 1.8), 0.1)
    builder.mesh("rope", "steel-galvanised", tube(rope, 0.004, 5))


def _lamp_post() -> Mesh:
    pole = lathe([(0, 0), (0.09, 0), (0.09, 0.9), (0.06, 0.95), (0.035, 5), (0, 5)], sections=14)
    arm = tube([(0, 0, 4.9), (0, -0.3, 5.2), (0, -1.1, 5.3)], 0.03, 8)
    return union([pole, arm, block((0.16, 0.6, 0.08), (0, -1.2, 5.28))])


def _bin() -> Mesh:
    """Wheeled bin of 240 l, its handle towards the house."""
    body = lathe([(0, 0.05), (0.32, 0.05), (0.4, 0.98), (0, 0.98)], sections=4)
    body.apply_transform(np.diag([1.0, 1.25, 1.0, 1.0]))
    lid = block((0.62, 0.74, 0.05), (0, 0, 1.02))
    wheels = [rod((x, 0.3, 0.1), (x + 0.05, 0.3, 0.1), 0.1, sections=14) for x in (-0.26, 0.21)]
    handle = rod((-0.22, 0.4, 0.97), (0.22, 0.4, 0.97), 0.015, sections=8)
    body.apply_transform(_QUARTER)
    return union([body, lid, *wheels, handle])


#: Rotates a lathe of four sections so that its sides face x and y.
_QUARTER = np.array(
    [[c := np.sqrt(0.5), -c, 0, 0], [c, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], float
)


def _bollard() -> Mesh:
    return lathe(
        [(0, 0), (0.06, 0), (0.06, 0.75), (0.08, 0.78), (0.08, 0.84), (0.05, 0.9), (0, 0.92)],
        sections=14,
    )


def _awning(width: float) -> Mesh:
    """Sheet that falls from the wall outwards, with a scalloped edge hanging down."""
    x = np.linspace(-width / 2, width / 2, 41)
    flat = np.zeros(41)
    wall = np.column_stack([x, flat - 0.02, flat + 0.35])
    edge = np.column_stack([x, flat - 1.0, flat])
    scallops = -0.12 - 0.06 * np.abs(np.sin(np.linspace(0, 8 * np.pi, 41)))
    hem = np.column_stack([x, flat - 1.0, scallops])
    return union([strip(wall, edge), strip(edge, hem)])


def _awning_arms(width: float) -> Mesh:
    return union(
        [
            rod((x, 0.0, -0.25), (x, -1.0, -0.01), 0.012, sections=6)
            for x in (-0.45 * width, 0.45 * width)
        ]
    )


def _sign(rng: np.random.Generator) -> Mesh:
    """Round or square sign on a bracket that sticks out of the wall."""
    bracket = rod((0, 0, 0.32), (0, -0.75, 0.32), 0.012, sections=6)
    chains = [rod((0, y, 0.2), (0, y, 0.32), 0.005, sections=4) for y in (-0.6, -0.25)]
    if rng.random() < 0.5:
        board = block((0.04, 0.5, 0.4), (0, -0.43, 0))
    else:
        board = rod((-0.02, -0.43, -0.02), (0.02, -0.43, -0.02), 0.25, sections=28)
    return union([bracket, *chains, board])


def _railing() -> Mesh:
    """Thin bars around a balcony of 1.8 m by 0.9 m."""
    posts = [(x, -0.86) for x in np.linspace(-0.87, 0.87, 16)]
    posts += [(x, y) for x in (-0.87, 0.87) for y in np.linspace(-0.74, -0.06, 7)]
    bars = [rod((x, y, 0), (x, y, 1.0), 0.007, sections=6) for x, y in posts]
    corners = [(-0.87, 0, 1.0), (-0.87, -0.86, 1.0), (0.87, -0.86, 1.0), (0.87, 0, 1.0)]
    return union([*bars, tube(corners, 0.02, 8)])


FAMILY = Family(
    "A street between houses with windows of glass, a parked car and a cable across",
    StreetParameters,
    build,
    min_spots=1,
)
