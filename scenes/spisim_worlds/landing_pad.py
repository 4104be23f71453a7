"""A landing pad from above: H, fiducial marker, lights, cable, tools, stones or snow around."""

from collections.abc import Callable

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts import props
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.houses import house
from spisim_worlds.parts.natural import blob, scattered_rocks
from spisim_worlds.parts.plants import tuft
from spisim_worlds.parts.ropes import hanging, lying
from spisim_worlds.parts.shapes import (
    Mesh,
    alike,
    bars,
    block,
    lathe,
    moved,
    rod,
    spread,
    tube,
    union,
)  # fmt: skip
from spisim_worlds.parts.vehicles import add_car

PAD_HEIGHT_M = 0.06
#: Thickness of painted and glued parts, which lie on a closed pad.
RELIEF_M = 0.003
GROUND_M = (40, 40)


class LandingPadParameters(Parameters):
    """A pad seen from `height_m` above the ground, its middle `pitch_deg` below the horizon."""

    height_m: float = drawn_log(1.6, 6.0, "of the drone above the ground")
    pitch_deg: float = drawn_log(10.0, 70.0, "down to the middle of the pad")
    pad_m: float = drawn(0.7, 1.2, "side or diameter of the pad")
    turn_deg: float = drawn(-60.0, 60.0, "of the pad; at 0 its H stands upright to us")
    shape: str = one_of("round", "square", text="of the pad")
    pad: str = one_of("concrete", "asphalt", "rubber-black", "wood-weathered", text="its material")
    marker_cells: int = drawn(4, 7, "cells of the fiducial marker each way, without its border")
    lights: int = drawn(0, 10, "around the edge")
    tools: int = drawn(0, 5, "things left beside the pad")
    cable_mm: float = drawn_log(5.0, 20.0, "diameter of the cable")
    mast_m: float = drawn(0.5, 1.2, "height of the mast with the windsock")
    around: str = one_of("gravel", "snow", "grass", "concrete", text="what the pad lies in")
    clutter: int = drawn(40, 300, "stones, lumps of snow or tufts around")
    standing: int = drawn(0, 10, "things that stand around the pad")
    aside_deg: float = drawn(-7.0, 7.0, "of the line of sight beside the pad, to the left")
    shelter: str = one_of("none", "shed", "fence", "person", "car", text="beyond the pad")


def build(parameters: LandingPadParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the pad around the origin, with the drone on the side of -x."""
    back = parameters.height_m / float(np.tan(np.radians(parameters.pitch_deg)))
    builder = SceneBuilder(
        position_m=(-back, 0.0, parameters.height_m),
        look_at_m=(float(rng.uniform(-0.1, 0.1)), float(rng.uniform(-0.1, 0.1)), PAD_HEIGHT_M),
        **outdoors(rng),
    )
    _AROUND[parameters.around](builder, parameters, rng)
    _add_pad(builder, parameters, rng)
    _add_lights(builder, parameters)
    _add_mast(builder, parameters, rng)
    _add_tools(builder, parameters, rng)
    reach, side = 0.5 * parameters.pad_m, float(rng.choice((-1, 1)))
    corners = [
        (-3.0, side * 2.5), (-0.9 * reach, side * 1.9 * reach), (0.2 * reach, side * 1.5 * reach),
        (0.9 * reach, side * 1.4 * reach), (0.8 * reach, side * 0.75 * reach),
    ]  # fmt: skip
    radius = parameters.cable_mm / 2000
    cable = lying(corners, 0.12 * reach, PAD_HEIGHT_M + radius, rng)
    outside = np.hypot(cable[:, 0], cable[:, 1]) > 1.02 * reach * np.sqrt(2)
    cable[outside, 2] = radius
    builder.mesh("cable", "pvc", tube(cable, radius))
    _look_aside(builder, parameters)
    _add_standing(builder, parameters, rng)
    _SHELTERS[parameters.shelter](builder, parameters, rng)
    return builder


def _look_aside(builder: SceneBuilder, parameters: LandingPadParameters) -> None:
    eye, aim = np.asarray(builder.position_m), np.asarray(builder.look_at_m)
    x, _, z = aim - eye
    off = np.hypot(x, z) * np.tan(np.radians(parameters.aside_deg))
    builder.look_at_m = (aim[0], aim[1] + off, aim[2])


def _add_standing(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    """Crates, drums, cones, cylinders and pallets with crates, from before the pad to beyond."""
    kinds = [
        ("crates", "plywood", _crates(rng)),
        ("drums", "steel-rusty", props.drum()),
        ("cones", "polypropylene", props.cone()),
        ("gas bottles", "steel-painted", props.gas_cylinder()),
    ]
    reach = 0.75 * parameters.pad_m + 0.4
    for number, (name, material, mesh) in enumerate(kinds):
        n = len(range(number, parameters.standing, len(kinds)))
        radius, angle = reach + rng.exponential(1.0, n), rng.uniform(-2.2, 2.2, n)
        positions = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
        if n:
            turns = rng.uniform(0, 360, n)
            builder.mesh(name, material, spread(mesh, positions, turns, rng.uniform(0.7, 1.2, n)))


def _crates(rng: np.random.Generator) -> Mesh:
    """A few boxes on top of each other, each turned a little."""
    stack, z = [], 0.0
    for _ in range(int(rng.integers(1, 4))):
        size = rng.uniform((0.4, 0.4, 0.3), (0.9, 0.9, 0.7))
        stack.append(block(size, (*rng.uniform(-0.08, 0.08, 2), z + size[2] / 2)))
        z += size[2]
    return union(stack)


def _no_shelter(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    """Add nothing beyond."""


def _beyond(parameters: LandingPadParameters, rng: np.random.Generator) -> tuple[float, float]:
    x = parameters.pad_m + rng.uniform(1.5, 4.0)
    return x, rng.uniform(-0.25, 0.25) * (x + 4)


def _shed(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    x, y = _beyond(parameters, rng)
    made = house(
        rng.uniform(2.5, 5), rng.uniform(2, 3.5), rng.uniform(1.9, 2.4), rng.uniform(0, 35)
    )
    at, turn = (x + 1.5, y, 0.0), (0, 0, rng.uniform(-40, 40))
    builder.mesh("shed", "wood-weathered", made.walls, at, turn)
    builder.mesh("roof of shed", "metal-roof", made.roof, at, turn)
    builder.mesh("windows of shed", "glass-painted-back", made.openings, at, turn)


def _fence(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    x, _ = _beyond(parameters, rng)
    slope, tall = rng.uniform(-0.5, 0.5), rng.uniform(0.9, 2.0)
    y = np.arange(-10, 10.1, 1.6)
    feet = np.stack([x + slope * y, y, 0 * y], axis=1)
    posts = np.stack([feet, feet + np.array([0, 0, tall])], axis=1)
    spans = np.stack([feet[:-1], feet[1:]], axis=1)
    wires = np.concatenate([spans + np.array([0, 0, z]) for z in np.linspace(0.1, tall, 9)])
    mesh = union([bars(posts, 0.03, 7), bars(wires, 0.004, 5)])
    builder.mesh("fence", "steel-galvanised", mesh)


def _person(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    x, y = _beyond(parameters, rng)
    props.add_worker(builder, (0.7 * x, y, 0.0), (0, 0, rng.uniform(0, 360)))


def _car(builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator) -> None:
    x, y = _beyond(parameters, rng)
    add_car(builder, (x + 1.0, y, 0.0), (0, 0, rng.uniform(0, 360)))


_SHELTERS: dict[str, Callable[[SceneBuilder, LandingPadParameters, np.random.Generator], None]] = {
    "none": _no_shelter,
    "shed": _shed,
    "fence": _fence,
    "person": _person,
    "car": _car,
}


def _add_pad(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    size, turn = parameters.pad_m, (0, 0, parameters.turn_deg)
    half, top = size / 2, PAD_HEIGHT_M
    if parameters.shape == "round":
        pad = rod((0, 0, -0.02), (0, 0, top), half, 64)
        edge = _ring(0.95 * half, 0.88 * half)
    else:
        pad = block((size, size, top + 0.02), (0, 0, (top - 0.02) / 2))
        edge = union(
            [
                block((0.94 * size, 0.05 * size, 2 * RELIEF_M), (0, s * 0.445 * size, top))
                for s in (-1, 1)
            ]
            + [
                block((0.05 * size, 0.84 * size, 2 * RELIEF_M), (s * 0.445 * size, 0, top))
                for s in (-1, 1)
            ]
        )
    builder.mesh("pad", parameters.pad, pad, (0, 0, 0), turn)
    letter = _letter(0.44 * size)
    left = (0.0, 0.15 * size, top)
    builder.mesh("edge marking", "paint-white", edge, (0, 0, 0), turn)
    builder.mesh("letter H", "paint-white", moved(letter, left), (0, 0, 0), turn)
    tile, cells = _marker(parameters.marker_cells, 0.36 * size, rng)
    right = (0.0, -0.19 * size, top)
    builder.mesh("marker", "paper-white", moved(tile, right), (0, 0, 0), turn)
    builder.mesh("dark cells of the marker", "paint-black", moved(cells, right), (0, 0, 0), turn)


def _letter(height: float) -> Mesh:
    """H, upright along x, its middle on the origin."""
    stroke, width = 0.18 * height, 0.62 * height
    bars = [
        block((height, stroke, 2 * RELIEF_M), (0, s * (width - stroke) / 2, 0)) for s in (-1, 1)
    ]
    return union([*bars, block((stroke, width - stroke, 2 * RELIEF_M), (0, 0, 0))])


def _marker(cells: int, size: float, rng: np.random.Generator) -> tuple[Mesh, Mesh]:
    """White tile with a quiet rim, and the dark cells on it: a border around random bits."""
    cell = size / (cells + 4)
    dark = np.ones((cells + 2, cells + 2), bool)
    dark[1:-1, 1:-1] = rng.random((cells, cells)) < 0.5
    tile = block((size, size, 2 * RELIEF_M), (0, 0, 0))
    middle = (cells + 1) / 2
    marks = [
        block((cell, cell, RELIEF_M), ((i - middle) * cell, (j - middle) * cell, RELIEF_M))
        for i, j in zip(*np.nonzero(dark), strict=True)
    ]
    return tile, union(marks)


def _ring(outer: float, inner: float) -> Mesh:
    """Flat ring on the pad."""
    low, high = PAD_HEIGHT_M - RELIEF_M, PAD_HEIGHT_M + RELIEF_M
    profile = [(inner, low), (outer, low), (outer, high), (inner, high), (inner, low)]
    return lathe(profile, sections=64)


def _add_lights(builder: SceneBuilder, parameters: LandingPadParameters) -> None:
    """Flush-mounted domes around the pad."""
    if parameters.lights == 0:
        return
    profile = [
        (0, 0),
        (0.05, 0),
        (0.05, 0.02),
        (0.03, 0.03),
        (0.03, 0.08),
        (0.018, 0.1),
        (0, 0.105),
    ]
    radius = parameters.pad_m / 2 * (1.12 if parameters.shape == "round" else 1.5)
    angles = 2 * np.pi * (np.arange(parameters.lights) + 0.5) / parameters.lights
    copies = [((0, 0, 0), (radius * np.cos(a), radius * np.sin(a), 0)) for a in angles]
    builder.mesh("edge light", "polypropylene", lathe(profile, 14), copies=copies)


def _add_mast(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    """A mast behind the pad with a windsock, held by a thin stay."""
    x, y = 0.62 * parameters.pad_m, float(rng.choice((-1, 1))) * 0.42 * parameters.pad_m
    top = (x, y, parameters.mast_m)
    mast = [rod((x, y, 0), top, 0.012, 10), rod((x, y, 0), (x, y, 0.02), 0.1, 16)]
    builder.mesh("mast", "steel-galvanised", union(mast))
    stay = hanging(top, (x + 0.5, y * 1.6, 0.0), sag=0.01, points=7)
    builder.mesh("stay", "steel-galvanised", tube(stay, 0.0015, sections=6))
    heading = rng.uniform(0, 2 * np.pi)
    out = 0.38 * np.array([np.cos(heading), np.sin(heading), -0.35])
    path = np.add(top, (0, 0, -0.06)) + np.linspace(0.03, 1, 5)[:, None] * out
    builder.mesh(
        "windsock", "polyester-fabric", tube(path, np.linspace(0.07, 0.035, 5).tolist(), 14)
    )


def _add_tools(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    """Add objects beside the pad, each at most once, in view of the drone."""
    reach = 0.5 * parameters.pad_m * (1.25 if parameters.shape == "round" else 1.5)
    angles = rng.permutation(np.linspace(0, 2 * np.pi, len(_TOOLS), endpoint=False))
    for name, angle in list(zip(rng.permutation(sorted(_TOOLS)), angles, strict=True))[
        : parameters.tools
    ]:
        material, make = _TOOLS[name]
        position = ((reach + 0.15) * np.cos(angle), (reach + 0.15) * np.sin(angle), 0.0)
        builder.mesh(str(name), material, make(), position, (0, 0, rng.uniform(0, 360)))


def _toolbox() -> Mesh:
    tray = block((0.22, 0.42, 0.2), (0, 0, 0.1))
    posts = [block((0.02, 0.02, 0.1), (0, y, 0.24)) for y in (-0.17, 0.17)]
    return union([tray, *posts, rod((0, -0.18, 0.28), (0, 0.18, 0.28), 0.013, 8)])


def _hammer() -> Mesh:
    head = block((0.12, 0.035, 0.035), (0, 0, 0.02))
    return union([head, rod((0, 0, 0.02), (0, 0.32, 0.016), 0.014, 8)])


def _spanner() -> Mesh:
    jaws = [
        block((0.02, 0.05, 0.01), (s * 0.022, y, 0.006)) for s in (-1, 1) for y in (-0.16, 0.16)
    ]
    return union([block((0.025, 0.28, 0.01), (0, 0, 0.006)), *jaws])


_TOOLS: dict[str, tuple[str, Callable[[], Mesh]]] = {
    "toolbox": ("steel-painted", _toolbox),
    "hammer": ("wood-dry", _hammer),
    "spanner": ("aluminium-rough", _spanner),
    "bucket": ("pvc", props.bucket),
    "cone": ("polypropylene", props.cone),
}


def _gravel(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    builder.rectangle("ground", "soil-field", GROUND_M)
    positions = _around(rng, parameters, parameters.clutter)
    sizes = rng.lognormal(np.log(0.05), 0.4, len(positions))
    builder.mesh("stones", "gravel", scattered_rocks(rng, positions, sizes))


def _snow(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    builder.rectangle("ground", "snow", GROUND_M)
    positions = _around(rng, parameters, parameters.clutter // 8)
    lumps = [
        moved(blob(rng, rng.uniform((0.1, 0.1, 0.06), (0.4, 0.35, 0.2)), 0.1, 2), position)
        for position in positions
    ]
    builder.mesh("lumps of snow", "snow", union(lumps))


def _grass(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    builder.rectangle("ground", "soil-field", GROUND_M)
    one = tuft(rng, 0.12, 16)
    positions = _around(rng, parameters, parameters.clutter)
    builder.mesh("grass", "grass", alike(one.vertices + positions[:, None], one.faces))


def _concrete(
    builder: SceneBuilder, parameters: LandingPadParameters, rng: np.random.Generator
) -> None:
    """Slabs with open joints, and a few stones."""
    builder.rectangle("ground", "asphalt", GROUND_M)
    slab, start = 0.8, rng.uniform(0, 0.8)
    steps = np.arange(-4.0, 4.1, slab) + start
    copies = [((0, 0, 0), (x, y, -0.02)) for x in steps for y in steps]
    builder.box("slab", "concrete-weathered", (0.97 * slab, 0.97 * slab, 0.05), copies=copies)
    positions = _around(rng, parameters, parameters.clutter // 5)
    builder.mesh(
        "stones", "gravel", scattered_rocks(rng, positions, rng.uniform(0.02, 0.05, len(positions)))
    )


def _around(rng: np.random.Generator, parameters: LandingPadParameters, count: int) -> Floats:
    """Return positions (n, 3) on the ground beside the pad, denser near it."""
    inner = parameters.pad_m * (0.56 if parameters.shape == "round" else 0.76)
    radius = inner + rng.exponential(0.4, count)
    angle = rng.uniform(0, 2 * np.pi, count)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)], axis=1)


_AROUND = {"gravel": _gravel, "snow": _snow, "grass": _grass, "concrete": _concrete}

FAMILY = Family(
    "A landing pad with H and fiducial marker, looked down on at an angle",
    LandingPadParameters,
    build,
    min_spots=2,
)
