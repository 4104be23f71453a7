"""A stairwell: two flights about a narrow well, winding stairs in a shaft, or a straight flight."""

import numpy as np
from trimesh.creation import torus

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, one_of
from spisim_worlds.parts.props import add_worker, bucket, ladder, open_carton
from spisim_worlds.parts.shapes import (
    Mesh,
    Point,
    block,
    lathe,
    limb,
    prism,
    rod,
    tube,
    union,
)  # fmt: skip
from spisim_worlds.parts.stairs import add_straight, add_winding

#: Free floor before the first step, depth of the landing, and gap between the flights.
LOBBY_M, LANDING_M, WELL_M = 3.6, 1.7, 0.25
SLAB_M, RAILING_M = 0.18, 0.95


class StairwellParameters(Parameters):
    """Of two flights, the first goes up ahead on the right, the second returns on the left."""

    looking: str = one_of("up", "down", text="from the lobby up, or from the landing down")
    steps: int = drawn(7, 11, "of each flight")
    rise_m: float = drawn(0.16, 0.19, "of a step")
    tread_m: float = drawn(0.26, 0.31, "of a step")
    width_m: float = drawn(1.0, 1.4, "of each flight")
    drone_height_m: float = drawn(1.3, 1.9, "above the floor below it")
    baluster_mm: float = drawn(8.0, 20.0, "diameter of the bars of the railing")
    balusters: int = drawn(1, 3, "bars per step")
    stairs: str = one_of("concrete", "wood-dry", "concrete-weathered", text="of steps and landing")
    walls: str = one_of("plasterboard", "concrete", "brick", text="of the walls")
    clutter: int = drawn(1, 5, "things left on stairs and landing")
    person: str = one_of("person", "none", text="on the first flight")
    window: str = one_of("window", "none", text="above the landing")
    shape: str = one_of("two-flights", "winding", "straight", text="of the stairs")
    gaze_deg: float = drawn(-15.0, 15.0, "of the line of sight, to the left")
    tilt_deg: float = drawn(-12.0, 12.0, "of the line of sight, down is positive")


def build(parameters: StairwellParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene: lobby at x = 0, the first step `LOBBY_M` ahead, the landing beyond."""
    if parameters.shape != "two-flights":
        return _other_stairs(parameters, rng)
    top = _landing_m(parameters)
    far = LOBBY_M + parameters.steps * parameters.tread_m
    # Looks across the railing from its right, so that its bars are separate.
    right, left = -parameters.width_m, 0.5 * parameters.width_m
    if parameters.looking == "up":
        position = (0.6, rng.uniform(0.5, 0.7) * right, parameters.drone_height_m)
        target = (far, rng.uniform(-0.2, 0.6) * left, rng.uniform(0.7, 1.1) * top)
    else:
        position = (
            far + 1.0,
            rng.uniform(0.4, 0.65) * right,
            top + parameters.drone_height_m - 0.1,
        )
        target = (LOBBY_M, rng.uniform(-0.8, 0.2) * left, rng.uniform(0.8, 1.4))
    aim = _turned(position, target, parameters.gaze_deg, parameters.tilt_deg)
    builder = SceneBuilder(position, aim, sky_klx=rng.uniform(5.0, 18.0))
    _shell(builder, parameters, top, far)
    _flights(builder, parameters, top)
    _railings(builder, parameters)
    _clutter(builder, parameters, rng)
    _fittings(builder, parameters, rng, top, far)
    return builder


def _turned(eye: Point, aim: Point, left_deg: float, down_deg: float) -> tuple[float, ...]:
    """Return the target after a turn to the left and down; unchanged if both are 0."""
    x, y, z = np.subtract(aim, eye)
    turn = np.radians(left_deg)
    c, s = np.cos(turn), np.sin(turn)
    z -= np.hypot(x, y) * np.tan(np.radians(down_deg))
    return tuple(float(v) for v in np.add(eye, (c * x - s * y, s * x + c * y, z)))


def _other_stairs(parameters: StairwellParameters, rng: np.random.Generator) -> SceneBuilder:
    """Add winding or straight stairs with a person or objects on them."""
    builder = SceneBuilder((0, 0, 0), (1, 0, 0), sky_klx=rng.uniform(5.0, 18.0))
    if parameters.shape == "winding":
        eye, aim = add_winding(builder, rng, parameters.rise_m, parameters.stairs, parameters.walls)
    else:
        eye, aim = add_straight(
            builder, rng, parameters.rise_m, parameters.tread_m, parameters.width_m,
            parameters.stairs, parameters.walls,
        )  # fmt: skip
    builder.position_m = tuple(eye)
    builder.look_at_m = _turned(tuple(eye), tuple(aim), parameters.gaze_deg, parameters.tilt_deg)
    view = (aim - eye) * (1, 1, 0) / np.hypot(*(aim - eye)[:2])
    cable = eye + rng.uniform(1.2, 2.5) * view + (*rng.uniform(-0.25, 0.25, 2), 0)
    swing = rng.normal(0, 0.05, (5, 3)) * (1, 1, 0)
    path = cable + swing + np.linspace(2.0, rng.uniform(-1.0, 0.3), 5)[:, None] * (0, 0, 1)
    builder.mesh("hanging cable", "rubber-black", tube(path, rng.uniform(0.002, 0.01), 6))
    return builder


def _landing_m(parameters: StairwellParameters) -> float:
    """Height of the landing."""
    return (parameters.steps + 1) * parameters.rise_m


def _shell(builder: SceneBuilder, parameters: StairwellParameters, top: float, far: float) -> None:
    """Walls, floor and ceiling as slabs that enclose it; a window at the far end if wanted."""
    half = parameters.width_m + WELL_M / 2
    end, ceiling = far + LANDING_M, 2 * top + 2.4
    length = end + 0.2
    builder.box("floor", parameters.stairs, (length, 2 * half, 0.1), (length / 2, 0, -0.05))
    builder.box("ceiling", "plasterboard", (length, 2 * half, 0.1), (length / 2, 0, ceiling))
    sides = [
        block((length, 0.1, ceiling + 0.1), (length / 2, way * (half + 0.05), ceiling / 2))
        for way in (-1, 1)
    ]
    near = block((0.1, 2 * half + 0.2, ceiling + 0.1), (-0.05, 0, ceiling / 2))
    builder.mesh("side walls", parameters.walls, union(sides))
    builder.mesh("wall with the door", parameters.walls, near)
    if parameters.window == "none":
        builder.box("end wall", parameters.walls, (0.1, 2 * half, ceiling + 0.1),
                  (end + 0.05, 0, ceiling / 2))  # fmt: skip
        return
    low, high, wide = top + 0.8, top + 2.0, 0.75 * half
    parts = [
        block((0.1, 2 * half, low), (end + 0.05, 0, low / 2)),
        block((0.1, 2 * half, ceiling - high + 0.1), (end + 0.05, 0, (ceiling + high) / 2)),
    ]
    parts += [
        block(
            (0.1, half - wide, high - low), (end + 0.05, way * (half + wide) / 2, (low + high) / 2)
        )
        for way in (-1, 1)
    ]
    builder.mesh("end wall", parameters.walls, union(parts))
    bars = [block((0.06, 0.05, high - low), (end + 0.05, y, (low + high) / 2))
            for y in np.linspace(-wide, wide, 4)]  # fmt: skip
    bars += [block((0.06, 2 * wide, 0.05), (end + 0.05, 0, z)) for z in (low, high)]
    builder.mesh("window frame", "paint-white", union(bars))
    centre = (end + 0.07, 0, (low + high) / 2)
    builder.rectangle("window pane", "glass-pane", (high - low, 2 * wide), centre, (0, 90, 0))
    # Ends laser beams that leave through the window.
    builder.box("house opposite", "brick", (0.2, 12, 14), (end + 3.0, 0, 4))


def _flights(builder: SceneBuilder, parameters: StairwellParameters, top: float) -> None:
    """Steps with a sloping slab below; the second flight starts from the landing."""
    flight = _flight(parameters)
    y = (parameters.width_m + WELL_M) / 2
    far = LOBBY_M + parameters.steps * parameters.tread_m
    positions: list[Pose] = [((0, 0, 0), (LOBBY_M, -y, 0)), ((0, 0, 180), (far, y, top))]
    builder.mesh("flight", parameters.stairs, flight, copies=positions)
    wide = 2 * parameters.width_m + WELL_M
    middle = far + LANDING_M / 2
    builder.box("landing", parameters.stairs, (LANDING_M, wide, SLAB_M),
              (middle, 0, top - SLAB_M / 2))  # fmt: skip
    edges = _nosing(parameters)
    builder.mesh("step edges", "aluminium-anodised", edges, copies=positions)


def _flight(parameters: StairwellParameters) -> Mesh:
    """Solid from x = 0, y = 0 in the middle: steps above, a slope below."""
    tread, rise, n = parameters.tread_m, parameters.rise_m, parameters.steps
    parts = [
        block((tread + 0.02, parameters.width_m, rise), ((k + 0.5) * tread, 0, (k + 0.5) * rise))
        for k in range(n)
    ]
    end = n * tread
    slope = [(0, -0.15), (end, (n - 1) * rise - 0.15), (end, (n - 0.5) * rise), (0, 0.5 * rise)]
    parts.append(prism(slope, parameters.width_m - 0.02))
    return union(parts)


def _nosing(parameters: StairwellParameters) -> Mesh:
    """Rounded edge of every step."""
    half = parameters.width_m / 2 - 0.03
    bars = []
    for k in range(parameters.steps):
        x, z = k * parameters.tread_m, (k + 1) * parameters.rise_m
        bars.append(rod((x, -half, z), (x, half, z), 0.012, sections=6))
    return union(bars)


def _slope(parameters: StairwellParameters, height: float) -> tuple[Floats, Floats]:
    """Ends of a line `height` above the edges of a flight's first and last step, at y = 0."""
    tread, rise, n = parameters.tread_m, parameters.rise_m, parameters.steps
    return np.array([0, 0, rise + height]), np.array([(n - 1) * tread, 0, n * rise + height])


def _railings(builder: SceneBuilder, parameters: StairwellParameters) -> None:
    """Bars and handrail along the well, on both flights and across the landing."""
    radius = parameters.baluster_mm / 2000
    (low, high), (first, last) = _slope(parameters, 0.0), _slope(parameters, RAILING_M)
    bars = []
    for t in np.linspace(0, 1, (parameters.steps - 1) * parameters.balusters + 1):
        foot, head = low + t * (high - low), first + t * (last - first)
        bars.append(rod(foot, head, radius, sections=6))
    post = rod((0, 0, 0), (0, 0, first[2] + 0.12), 0.025, sections=10)
    knob = lathe([(0, 0), (0.04, 0.02), (0.05, 0.05), (0.03, 0.09), (0, 0.1)], sections=14)
    knob.apply_translation((0, 0, first[2] + 0.11))
    inner = WELL_M / 2 + 0.05
    far = LOBBY_M + parameters.steps * parameters.tread_m
    positions: list[Pose] = [
        ((0, 0, 0), (LOBBY_M, -inner, 0)),
        ((0, 0, 180), (far, inner, _landing_m(parameters))),
    ]
    builder.mesh("balusters", "steel-painted", union(bars), copies=positions)
    bent = np.array([0.1, 0, 0.03])
    rail = tube([first - bent, first, last, last + bent], 0.024, 10)
    builder.mesh("handrail", "wood-dry", rail, copies=positions)
    builder.mesh("newel post", "wood-dry", union([post, knob]), copies=positions)
    wall_rail = tube([first, last], 0.02, 8)
    outer = WELL_M / 2 + parameters.width_m - 0.08
    on_walls: list[Pose] = [
        ((0, 0, 0), (LOBBY_M, -outer, -0.05)),
        ((0, 0, 180), (far, outer, _landing_m(parameters) - 0.05)),
    ]
    builder.mesh("rail on the wall", "steel-galvanised", wall_rail, copies=on_walls)


def _clutter(
    builder: SceneBuilder, parameters: StairwellParameters, rng: np.random.Generator
) -> None:
    """Add objects on steps, and sometimes a person walking up."""
    y = -(parameters.width_m + WELL_M) / 2
    taken = int(rng.integers(1, parameters.steps // 2))
    free = [step for step in range(parameters.steps - 1) if abs(step - taken) > 1]
    positions = rng.permutation(free)[: parameters.clutter]
    things = rng.permutation(sorted(_THINGS))[: len(positions)]
    for name, step in zip(things, positions, strict=True):
        material, make = _THINGS[name]
        x = LOBBY_M + (step + 0.55) * parameters.tread_m
        at = (x, y + rng.uniform(-0.35, 0.35) * parameters.width_m, (step + 1) * parameters.rise_m)
        builder.mesh(name, material, make(), at, (0, 0, rng.uniform(0, 360)))
    if parameters.person == "person":
        x = LOBBY_M + (taken + 0.5) * parameters.tread_m
        at = (x, y + rng.uniform(-0.2, 0.2), (taken + 1) * parameters.rise_m)
        turn = (0, 0, 180 + rng.uniform(-20, 20))
        add_worker(builder, at, turn, "cotton-white", "polyester-fabric")


def _fittings(
    builder: SceneBuilder,
    parameters: StairwellParameters,
    rng: np.random.Generator,
    top: float,
    far: float,
) -> None:
    """Fire extinguisher, pipes, lamp, ladder on the landing, a cable hanging down the well."""
    half = parameters.width_m + WELL_M / 2
    wall = far + LANDING_M
    pipes = [
        rod((wall - 0.08, y, 0), (wall - 0.08, y, 2 * top + 2.3), 0.03, sections=10)
        for y in (-half + 0.1, -half + 0.22)
    ]
    builder.mesh("riser pipes", "steel-painted", union(pipes))
    at = (wall - 0.14, rng.uniform(-0.7, -0.3) * half, top + 0.25)
    builder.mesh("fire extinguisher", "steel-painted", _extinguisher(), at)
    leaning = (wall - 0.75, rng.uniform(0.3, 0.7) * half, top)
    builder.mesh("ladder", "aluminium-anodised", ladder(), leaning, (0, 14, 0))
    x = LOBBY_M + rng.uniform(0.2, 0.7) * (far - LOBBY_M)
    drop = [(x, 0, 2 * top + 2.4), (x + 0.02, 0.01, top + 1.5), (x, -0.02, 0.3)]
    builder.mesh("hanging cable", "rubber-black", tube(drop, rng.uniform(0.002, 0.006), 6))
    builder.box("door", "wood-dry", (0.06, 0.9, 2.0), (0.03, rng.uniform(-0.3, 0.3) * half, 1.0))
    shade = (far + 0.8, 0, 2 * top + 2.2)
    builder.cylinder("ceiling lamp", "paint-white", (0.2, 0.1), shade)


def _extinguisher() -> Mesh:
    bottle = [(0, 0), (0.075, 0), (0.08, 0.02), (0.08, 0.4), (0.05, 0.46), (0.02, 0.48)]
    body = lathe([*bottle, (0.02, 0.54), (0, 0.54)], sections=20)
    hose = tube([(-0.02, 0, 0.5), (-0.1, 0.04, 0.48), (-0.11, 0.05, 0.3), (-0.1, 0.05, 0.1)], 0.01)
    lever = block((0.14, 0.03, 0.02), (-0.03, 0, 0.56))
    return union([body, hose, lever])


def _bucket() -> Mesh:
    handle = tube([(0, -0.15, 0.28), (0, -0.12, 0.4), (0, 0.12, 0.4), (0, 0.15, 0.28)], 0.004, 5)
    return union([bucket(), handle])


def _broom() -> Mesh:
    stick = rod((0, 0, 0.08), (0.25, 0, 1.35), 0.012, sections=8)
    head = block((0.06, 0.3, 0.05), (0, 0, 0.09))
    bristles = [block((0.02, 0.02, 0.08), (0, y, 0.04)) for y in np.linspace(-0.14, 0.14, 8)]
    return union([stick, head, *bristles])


def _bag() -> Mesh:
    body = limb((0, -0.1, 0.11), (0, 0.1, 0.11), 0.11)
    handle = torus(0.09, 0.008, major_sections=20, minor_sections=6)
    handle.apply_transform(np.array([[0, 0, 1.0, 0], [1, 0, 0, 0], [0, 1, 0, 0.23], [0, 0, 0, 1]]))
    return union([body, handle])


_THINGS = {
    "bucket": ("polypropylene", _bucket),
    "broom": ("wood-dry", _broom),
    "bag": ("leather", _bag),
    "carton": ("cardboard", lambda: open_carton().apply_scale(0.6)),
    "ball": ("rubber-black", lambda: limb((0, 0, 0.11), (0, 0, 0.111), 0.11)),
}

FAMILY = Family(
    "Stairs: two flights and a landing, winding in a shaft, or straight; railings of thin bars",
    StairwellParameters,
    build,
    min_spots=3,
)
