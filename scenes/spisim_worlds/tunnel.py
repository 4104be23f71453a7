"""A service tunnel: round or horseshoe, with pipes, cable trays, lamps, a valve and niches."""

from collections.abc import Callable

import numpy as np
from trimesh.creation import icosphere, torus

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts import vault
from spisim_worlds.parts.natural import blob
from spisim_worlds.parts.props import add_worker, cone, drum, gas_cylinder, pallet, tyre
from spisim_worlds.parts.shapes import (
    Mesh,
    block,
    lathe,
    moved,
    prism,
    rod,
    spread,
    tube,
    union,
)

#: The tunnel starts this far behind the drone.
START_M = -2.0


class TunnelParameters(Parameters):
    """The drone flies on the right of the axis and looks a little to the left."""

    profile: str = one_of("round", "horseshoe", "box", "oval", text="of the tunnel")
    radius_m: float = drawn(1.5, 3.2, "of the vault")
    length_m: float = drawn_log(6.5, 40.0, "from the drone to what closes the tunnel")
    end: str = one_of("bulkhead", "rubble", text="what closes it")
    lining: str = one_of("concrete", "concrete-weathered", "brick", text="of the vault")
    rib_spacing_m: float = drawn(1.0, 2.5, "of the ribs of the lining")
    pipes: int = drawn(2, 4, "along the left wall")
    pipe_mm: float = drawn(70.0, 220.0, "diameter of the thickest pipe")
    cables: int = drawn(2, 6, "in the tray above the pipes")
    lamp_spacing_m: float = drawn(1.8, 3.5, "of the lamps below the vault")
    niches: int = drawn(0, 2, "in the left wall")
    hanging: int = drawn(1, 4, "cables that hang into the way")
    hanging_mm: float = drawn_log(4.0, 25.0, "diameter of these")
    track: str = one_of("track", "none", text="on the floor")
    worker: str = one_of("worker", "none", text="at the pipes")
    aside: float = drawn(-0.3, 0.9, "how much farther left the drone flies, in radii")
    gaze_deg: float = drawn(-26.0, 22.0, "of the line of sight, to the left")
    tilt_deg: float = drawn(-14.0, 12.0, "of the line of sight, down is positive")
    stores: int = drawn(0, 12, "things left on the floor")
    props: int = drawn(0, 5, "frames of steel or timber below the vault")


def build(parameters: TunnelParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the tunnel along x with the floor at z = 0."""
    radius = parameters.radius_m
    position = (0.0, -rng.uniform(0.2, 0.45) * radius, rng.uniform(0.9, 1.3))
    ahead = 0.7 * parameters.length_m
    builder = SceneBuilder(position, (ahead, rng.uniform(0.3, 0.6) * radius, rng.uniform(0.8, 1.3)))
    outline = vault.outline_of(parameters.profile, radius)
    positions = _niches(parameters, rng)
    lining = vault.lining(outline, START_M, parameters.length_m, positions)
    builder.mesh("lining", parameters.lining, lining)
    joints = np.arange(START_M + 0.3, parameters.length_m - 0.2, parameters.rib_spacing_m)
    builder.mesh("ribs", "concrete", vault.ribs(outline, joints))
    length = parameters.length_m - START_M
    floor = (length, 2 * radius, 0.02)
    builder.box("floor", "concrete-weathered", floor, (START_M + length / 2, 0, -0.005))
    _ENDS[parameters.end](builder, parameters, rng)
    _pipes(builder, parameters, outline, rng)
    _tray(builder, parameters, outline, rng)
    _lamps(builder, parameters, outline)
    _hanging(builder, parameters, outline, rng)
    _on_the_floor(builder, parameters, rng)
    _look_elsewhere(builder, parameters)
    _stores(builder, parameters, rng)
    _frames(builder, parameters, outline, rng)
    return builder


def _look_elsewhere(builder: SceneBuilder, parameters: TunnelParameters) -> None:
    """Move the drone to the left and turn it, unless both are 0."""
    eye, aim = np.asarray(builder.position_m, float), np.asarray(builder.look_at_m, float)
    eye[1] += parameters.aside * parameters.radius_m
    eye[1] = np.clip(eye[1], -0.5 * parameters.radius_m, 0.45 * parameters.radius_m)
    turn, tilt = np.radians([parameters.gaze_deg, parameters.tilt_deg])
    x, y, z = aim - np.asarray(builder.position_m)
    ahead = np.array([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z])
    ahead[2] -= x * np.tan(tilt)
    builder.position_m, builder.look_at_m = tuple(eye), tuple(eye + ahead)


def _stores(builder: SceneBuilder, parameters: TunnelParameters, rng: np.random.Generator) -> None:
    """Add crates, cones, bottles and pallets along the way, and a ladder to the vault."""
    kinds = [
        ("crates", "plywood", block((0.6, 0.5, 0.5), (0, 0, 0.25))),
        ("cones", "polypropylene", cone()),
        ("gas bottles", "steel-painted", gas_cylinder()),
        ("pallets", "wood-weathered", pallet()),
        ("sacks", "burlap", blob(rng, (0.7, 0.45, 0.25), 0.1).apply_translation((0, 0, 0.12))),
    ]
    for number, (name, material, mesh) in enumerate(kinds):
        n = len(range(number, parameters.stores, len(kinds)))
        x = 2.5 * (min(parameters.length_m, 16.0) / 2.5) ** rng.random(n)
        y = rng.uniform(-0.8, 0.8, n) * parameters.radius_m * 0.75
        if n:
            turns, sizes = rng.uniform(0, 360, n), rng.uniform(0.7, 1.3, n)
            positions = np.stack([x, y, 0 * x + 0.01], axis=1)
            builder.mesh(name, material, spread(mesh, positions, turns, sizes))


def _frames(
    builder: SceneBuilder, parameters: TunnelParameters, outline: Floats, rng: np.random.Generator
) -> None:
    """Add posts and a beam across every metre or two, as under rock pressure."""
    if not parameters.props:
        return
    high, half = 0.92 * float(outline[:, 1].max()), 0.72 * parameters.radius_m
    wide = rng.uniform(0.1, 0.22)
    high = min(high, float(np.interp(half, *vault.half_profile(outline))) - 0.05)
    frame = [block((wide, wide, high), (0, s * half, high / 2)) for s in (-1, 1)]
    frame.append(block((wide, 2 * half + wide, wide), (0, 0, high)))
    x = rng.uniform(1.8, 4) + np.arange(parameters.props) * rng.uniform(0.9, 3.0)
    x = x[x < parameters.length_m - 0.5]
    material = str(rng.choice(["wood-weathered", "steel-rusty"]))
    if len(x):
        positions = np.stack([x, 0 * x, 0 * x], axis=1)
        builder.mesh("frames", material, spread(union(frame), positions, 0, 1))


def _niches(parameters: TunnelParameters, rng: np.random.Generator) -> list[float]:
    """Return starts of niches along x, separated from each other."""
    wide = vault.NICHE_LENGTH_M
    slots = np.arange(2.5, parameters.length_m - wide - 0.3, wide + 0.6)
    return sorted(float(x) for x in rng.permutation(slots)[: parameters.niches])


def _bulkhead(
    builder: SceneBuilder, parameters: TunnelParameters, rng: np.random.Generator
) -> None:
    """Wall with a steel door, its wheel, hinges and a grille."""
    x, radius = parameters.length_m, parameters.radius_m
    builder.box("bulkhead", "concrete", (0.2, 2 * radius + 0.2, 2 * radius), (x + 0.1, 0, radius))
    y = rng.uniform(-0.1, 0.35) * radius
    builder.box("bulkhead door", "steel-rusty", (0.12, 0.9, 1.8), (x - 0.05, y, 0.95))
    wheel = torus(0.18, 0.018, major_sections=24, minor_sections=8)
    spokes = [
        rod((0, 0, 0), (0.18 * np.cos(a), 0.18 * np.sin(a), 0), 0.012, sections=6)
        for a in np.linspace(0, 2 * np.pi, 5)[:-1]
    ]
    hub = rod((0, 0, -0.2), (0, 0, 0.04), 0.03, sections=10)
    at, turn = (x - 0.25, y, 1.0), (0, -90, 0)
    builder.mesh("door wheel", "steel-painted", union([wheel, *spokes, hub]), at, turn)
    slats = [block((0.05, 0.6, 0.03), (x - 0.03, y - 0.95, z)) for z in np.arange(1.2, 1.7, 0.07)]
    builder.mesh("grille", "steel-galvanised", union(slats))


def _rubble(builder: SceneBuilder, parameters: TunnelParameters, rng: np.random.Generator) -> None:
    """A fall of rock that fills the tunnel."""
    x, radius = parameters.length_m, parameters.radius_m
    builder.box("rock face", "soil-field", (0.2, 2 * radius + 1, 3 * radius), (x + 0.1, 0, radius))
    heap = prism([(x - 1.4, 0), (x, 0), (x, 1.4 * radius)], 1.9 * radius)
    stones = [heap]
    for _ in range(70):
        stone = icosphere(1, rng.uniform(0.12, 0.45))
        stone.vertices *= rng.uniform(0.75, 1.25, stone.vertices.shape)
        ahead = rng.uniform(0.0, 1.6)
        high = rng.uniform(0.0, 1.0) * max(0.1, 1 - ahead / 1.5) * 1.4 * radius
        stones.append(moved(stone, (x - ahead, rng.uniform(-0.85, 0.85) * radius, high)))
    builder.mesh("fallen rock", "gravel", union(stones))
    prop = rod(
        (x - 1.2, 0.3 * radius, 0), (x - 0.9, 0.35 * radius, 1.4 * radius), 0.08, sections=12
    )
    beam = block((0.14, 1.5 * radius, 0.14), (x - 0.95, 0, 1.38 * radius))
    builder.mesh("timber props", "wood-weathered", union([prop, beam]))


_ENDS: dict[str, Callable[[SceneBuilder, TunnelParameters, np.random.Generator], None]] = {
    "bulkhead": _bulkhead,
    "rubble": _rubble,
}


def _pipes(
    builder: SceneBuilder, parameters: TunnelParameters, outline: Floats, rng: np.random.Generator
) -> None:
    """Pipes of different thickness above each other on brackets, flanges, a valve in the lowest."""
    end = parameters.length_m - 0.05
    height = 0.3
    for i in range(parameters.pipes):
        radius = parameters.pipe_mm / 2000 * (1.0 if i == 0 else rng.uniform(0.35, 0.8))
        height += radius
        y = min(vault.left_wall(outline, height + d) for d in (-radius, radius)) - radius - 0.1
        pipe = [rod((START_M, y, height), (end, y, height), radius, sections=16)]
        for x in np.arange(rng.uniform(1.5, 2.5), end, rng.uniform(1.8, 3.0)):
            pipe += [
                rod((x + d, y, height), (x + d + 0.03, y, height), 1.45 * radius, sections=16)
                for d in (-0.035, 0.005)
            ]
            pipe.append(block((0.05, 0.3, 0.04), (x + 0.3, y + 0.12, height - radius)))
        material = ("steel-rusty", "steel-galvanised", "pvc")[i % 3]
        builder.mesh(f"pipe {i + 1}", material, union(pipe))
        if i == 0:
            x = rng.uniform(0.35, 0.65) * parameters.length_m
            builder.mesh("valve", "steel-painted", _valve(radius), (x, y, height), (-60, 0, 0))
        height += radius + 0.08


def _valve(radius: float) -> Mesh:
    """Gate valve about a pipe along x, its spindle up towards the wheel."""
    body = rod((-0.1, 0, 0), (0.1, 0, 0), 1.3 * radius, sections=16)
    bonnet = rod((0, 0, 0), (0, 0, radius + 0.22), 0.6 * radius + 0.02, sections=12)
    spindle = rod((0, 0, radius + 0.2), (0, 0, radius + 0.4), 0.015, sections=8)
    wheel = torus(0.14, 0.014, major_sections=24, minor_sections=8)
    spokes = [
        rod((0, 0, 0), (0.14 * np.cos(a), 0.14 * np.sin(a), 0), 0.01, sections=6)
        for a in np.linspace(0, 2 * np.pi, 6)[:-1]
    ]
    turned = moved(union([wheel, *spokes]), (0, 0, radius + 0.38))
    return union([body, bonnet, spindle, turned])


def _tray(
    builder: SceneBuilder, parameters: TunnelParameters, outline: Floats, rng: np.random.Generator
) -> None:
    """Ladder tray on consoles at shoulder height, with cables that hang through between rungs."""
    z = 1.65
    y = min(vault.left_wall(outline, z + d) for d in (-0.05, 0.15)) - 0.22
    end = parameters.length_m - 0.05
    rails = [
        block((end - START_M, 0.012, 0.06), ((end + START_M) / 2, y + d, z)) for d in (-0.15, 0.15)
    ]
    rungs = [
        block((0.025, 0.3, 0.015), (x, y, z - 0.02)) for x in np.arange(START_M + 0.2, end, 0.3)
    ]
    consoles = [
        prism(
            [(-0.02, -0.12), (0.02, -0.12), (0.02, -0.03), (-0.02, -0.03)], 0.34
        ).apply_translation((x, y + 0.03, z))
        for x in np.arange(START_M + 0.6, end, 1.5)
    ]
    builder.mesh("cable tray", "steel-galvanised", union([*rails, *rungs, *consoles]))
    cables = []
    along = np.arange(START_M, end, 0.35)
    for _ in range(parameters.cables):
        radius = rng.uniform(0.006, 0.018)
        wave = y + rng.uniform(-0.11, 0.11) + rng.normal(0, 0.008, len(along))
        line = np.column_stack([along, wave, np.full(len(along), z + radius - 0.01)])
        cables.append(tube(line, radius, 6))
    builder.mesh("cables", "rubber-black", union(cables))


def _lamps(builder: SceneBuilder, parameters: TunnelParameters, outline: Floats) -> None:
    """Bulkhead lamps in cages below the vault, and the conduit that feeds them."""
    top = outline[:, 1].max() - 0.06
    glass = lathe([(0, -0.22), (0.05, -0.2), (0.07, -0.1), (0.07, 0.0), (0, 0.0)], sections=16)
    hoops = []
    for a in np.linspace(0, 2 * np.pi, 7)[:-1]:
        y, z = 0.09 * np.cos(a), 0.09 * np.sin(a)
        hoops.append(tube([(y, z, 0.0), (y, z, -0.15), (0, 0, -0.26)], 0.004, 5))
    xs = np.arange(1.2, parameters.length_m - 0.3, parameters.lamp_spacing_m)
    copies: list[Pose] = [((0, 0, 0), (x, 0.0, top)) for x in xs]
    builder.mesh("lamp", "paint-white", glass, copies=copies)
    builder.mesh("lamp cage", "steel-galvanised", union(hoops), copies=copies)
    conduit = rod((START_M, 0, top + 0.01), (parameters.length_m, 0, top + 0.01), 0.014, sections=8)
    builder.mesh("conduit", "pvc", conduit)


def _hanging(
    builder: SceneBuilder, parameters: TunnelParameters, outline: Floats, rng: np.random.Generator
) -> None:
    """Loose cables, either down from the vault or in a slack loop across the way."""
    radius, top = parameters.radius_m, float(outline[:, 1].max())
    wires = []
    eye, target = np.array(builder.position_m), np.array(builder.look_at_m)
    for i in range(parameters.hanging):
        fraction = (1.8 + 1.3 * i + rng.uniform(0, 0.6)) / (target[0] - eye[0])
        x, y, z = eye + fraction * (target - eye)
        y += rng.uniform(-0.12, 0.12) * x
        thick = parameters.hanging_mm / 2000 * (1.0 if i == 0 else rng.uniform(0.4, 1.0))
        if i % 2 == 0:
            low = z - rng.uniform(-0.1, 0.3)
            swing = rng.normal(0, 0.05, (3, 2))
            line = [(x, y, top), *((x + a, y + b, h) for (a, b), h in zip(
                swing, (z + 0.6, z + 0.25, low), strict=True))]  # fmt: skip
        else:
            t = np.linspace(-1, 1, 15)
            line = list(zip(x + 0.2 * t, 0.85 * radius * t, z + 0.1 + 0.5 * t**2, strict=True))
        wires.append(tube(line, thick, 6))
    builder.mesh("hanging cables", "rubber-black", union(wires))


def _on_the_floor(
    builder: SceneBuilder, parameters: TunnelParameters, rng: np.random.Generator
) -> None:
    """Add a track, a drum, a tyre, a puddle, and a worker."""
    radius = parameters.radius_m
    if parameters.track == "track":
        xs = np.arange(START_M, parameters.length_m, 0.6)
        sleepers: list[Pose] = [((0, 0, 0), (x, -0.1, 0.04)) for x in xs]
        builder.box("sleeper", "wood-weathered", (0.2, 1.2, 0.09), copies=sleepers)
        length = parameters.length_m - START_M
        rails: list[Pose] = [((0, 0, 0), (START_M + length / 2, y, 0.13)) for y in (-0.45, 0.25)]
        builder.box("rail", "steel-rusty", (length, 0.05, 0.1), copies=rails)
    builder.mesh("drum", "steel-rusty", drum(), (rng.uniform(4.5, 7.5), -0.5 * radius, 0.01))
    at = (rng.uniform(4.0, 6.0), 0.3 * radius, 0.01)
    builder.mesh("tyre", "rubber-black", tyre(), at)
    puddle = (rng.uniform(3.0, 6.0), 0.1 * radius, 0.01)
    builder.rectangle("puddle", "water", (1.8, 0.7), puddle)
    if parameters.worker == "worker":
        at = (rng.uniform(5.0, 7.5), rng.uniform(0.15, 0.35) * radius, 0.01)
        turn = (0, 0, rng.uniform(-60, 60))
        add_worker(builder, at, turn)


FAMILY = Family(
    "A service tunnel with pipes, a valve, cable trays and cables hanging into the way",
    TunnelParameters,
    build,
    min_spots=3,
)
