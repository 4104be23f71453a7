"""An open field with poles, fences, bales, bushes, animals and machines."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from trimesh.creation import icosphere

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.figure import COATS, SIZES, animal
from spisim_worlds.parts.houses import add_houses
from spisim_worlds.parts.natural import clipped_bush, scattered_rocks
from spisim_worlds.parts.plants import blades
from spisim_worlds.parts.props import add_worker
from spisim_worlds.parts.shapes import (
    bars,
    block,
    lathe,
    moved,
    rod,
    spread,
    union,
)  # fmt: skip
from spisim_worlds.parts.terrain import Terrain, hills, patchwork, terrain, waves
from spisim_worlds.parts.vehicles import add_car, add_tractor, add_van
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view, scattered_tufts

GROUNDS = ("grass", "soil-field", "soil-dry", "leaves-dry", "sand-dry", "gravel")


class FieldParameters(Parameters):
    """The drone flies low over the land, or as high as the objects on it."""

    drone_height_m: float = drawn_log(1.0, 6.0, "above the ground")
    pitch_deg: float = drawn(-8.0, 15.0, "of the line of sight, down is positive")
    relief_m: float = drawn(0.05, 1.5, "height of the land's waves")
    crop: str = one_of("pasture", "rows", "tall-grass", "bare", text="what grows")
    nearest_m: float = drawn_log(2.0, 8.0, "to what stands nearest")
    poles: int = drawn(0, 6, "in a row, with wires from one to the next")
    pole_line_deg: float = drawn(-80.0, 80.0, "of that row to the line of sight")
    fence: str = one_of("none", "wire", "rails", "wall", text="across the land")
    bales: int = drawn(0, 8, "of hay, round or square")
    bushes: int = drawn(0, 12, "here and there")
    animals: str = one_of("none", *SIZES, text="on the pasture")
    herd: int = drawn(1, 9, "animals, where there are any")
    machine: str = one_of("none", "tractor", "car", "van", "irrigation", text="in the field")
    person: str = one_of("none", "person", text="somebody in the field")
    trees: int = drawn(0, 8, "here and there")
    hills_m: float = drawn(0.0, 700.0, "height of the hills behind")


def build(parameters: FieldParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the drone over the origin, looking along x."""
    rolling, far = waves(rng, (12, 70)), hills(rng, rng.uniform(250, 1200), parameters.hills_m)
    land = terrain(
        lambda x, y: parameters.relief_m * rolling(x, y) + far(x, y), ((-3, 45), (-12, 12)), 0.8
    )
    eye = land.on(0, 0, -parameters.drone_height_m)
    aim = eye[2] - 10 * np.tan(np.radians(parameters.pitch_deg))
    builder = SceneBuilder(eye, (10.0, 0.0, aim), **outdoors(rng))
    grounds = [str(kind) for kind in rng.permutation(GROUNDS)[:3]]
    land.add(builder, grounds, patchwork(rng, land, 3, 5.0))
    _crop(builder, parameters, rng, land)
    _poles(builder, parameters, rng, land)
    _FENCES[parameters.fence](builder, parameters, rng, land)
    _bales(builder, parameters, rng, land)
    _herd(builder, parameters, rng, land)
    _machine(builder, parameters, rng, land)
    _plants(builder, parameters, rng, land)
    houses = in_view(rng, land, int(rng.integers(0, 3)), 60, 300)
    add_houses(builder, rng, [tuple(position) for position in houses])
    add_far_woods(builder, rng, land, int(rng.integers(2, 10)), 90.0)
    return builder


def _start(parameters: FieldParameters) -> float:
    """Return where the ground enters the view, as if it were flat."""
    low = np.radians(max(4.0, parameters.pitch_deg + 11))
    return max(1.5, parameters.drone_height_m / float(np.tan(low)))


def _spots(
    parameters: FieldParameters, rng: np.random.Generator, land: Terrain, count: int,
    far: float = 4.0,
) -> Floats:  # fmt: skip
    """Return positions (n, 3) in view, from the nearest object to `far` times its distance."""
    nearest = max(parameters.nearest_m, 0.5 * _start(parameters))
    return in_view(rng, land, count, nearest, far * nearest, 10)


def _crop(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Tufts, rows of plants, clods and stones."""
    start = _start(parameters)
    if parameters.crop in ("pasture", "tall-grass"):
        tall = rng.uniform(0.15, 0.35) * (4 if parameters.crop == "tall-grass" else 1)
        tall = min(tall, 0.6 * parameters.drone_height_m)
        season = str(rng.choice(["grass", "leaves-dry"]))
        builder.mesh("grass", season, scattered_tufts(rng, land, 1400, start, 8 * start, tall))
    elif parameters.crop == "rows":
        turn, gap = np.radians(rng.uniform(-70, 70)), rng.uniform(0.5, 1.6)
        c, s = np.cos(turn), np.sin(turn)
        x, y, _ = in_view(rng, land, 900, start, 6 * start).T
        across = np.round((-s * x + c * y) / gap) * gap + rng.normal(0, 0.04, len(x))
        along = c * x + s * y
        flat = land.positions(c * along - s * across, s * along + c * across)
        size = min(gap * rng.uniform(0.4, 0.9), 0.5 * parameters.drone_height_m)
        leaf = rng.normal((0, 0, 0.3 * size), 0.2 * size, (30, 3))
        plant = blades(rng, leaf, leaf - np.array([0, 0, 0.1 * size]), 0.35 * size)
        turns, scales = rng.uniform(0, 360, len(flat)), rng.uniform(0.6, 1.3, len(flat))
        builder.mesh("plants", "leaves-green", spread(plant, flat, turns, scales))
    positions = in_view(rng, land, 60, start, 6 * start)
    sizes = rng.lognormal(-2.0, 0.7, 60)
    builder.mesh("stones", str(rng.choice(["rock-granite", "soil-dry", "rock-limestone"])),
               scattered_rocks(rng, positions, sizes))  # fmt: skip


def _poles(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Wooden poles with wires, from one side of the view to the other or into the distance."""
    if not parameters.poles:
        return
    turn = np.radians(parameters.pole_line_deg)
    step = np.array([np.cos(turn), np.sin(turn)])
    first = _spots(parameters, rng, land, 1, 1.6)[0, :2]
    span, tall = rng.uniform(15, 45), max(3.5, parameters.drone_height_m * rng.uniform(0.8, 1.5))
    feet = first + np.arange(-1, parameters.poles)[:, None] * span * step
    feet = feet[(np.hypot(*feet.T) > 2.0)]
    positions = land.positions(*feet.T)
    arm = rng.uniform(0.6, 1.4)
    pole = lathe([(0, -0.3), (0.13, -0.3), (0.09, tall), (0, tall)], 12)
    cross = block((0.1, 2 * arm, 0.1), (0, 0, tall - 0.3))
    caps = [moved(lathe([(0, 0), (0.05, 0), (0.06, 0.1), (0, 0.16)], 10), (0, y, tall - 0.25))
            for y in (-arm * 0.9, 0, arm * 0.9)]  # fmt: skip
    builder.mesh("poles", "wood-weathered",
               spread(union([pole, cross]), positions, parameters.pole_line_deg, 1))  # fmt: skip
    builder.mesh("insulators", "glass-painted-back",
               spread(union(caps), positions, parameters.pole_line_deg, 1))  # fmt: skip
    if len(positions) < 2:
        return
    across = np.array([-step[1], step[0], 0])
    sag = -4 * 0.02 * span * np.array([0, 0, 1])
    t = np.linspace(0, 1, 15)[:, None]
    runs = []
    for y in (-arm * 0.9, 0, arm * 0.9):
        for a, b in pairwise(positions + y * across + np.array([0, 0, tall - 0.12])):
            path = a + t * (b - a) + t * (1 - t) * sag
            runs.append(np.stack([path[:-1], path[1:]], axis=1))
    wires = bars(np.concatenate(runs), rng.uniform(0.004, 0.012), 6)
    builder.mesh("wires", "aluminium-rough", wires)


def _no_fence(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Leave the land open."""


def _course(
    parameters: FieldParameters, rng: np.random.Generator, land: Terrain, step: float
) -> Floats:
    """Return feet (n, 3) of a fence, wall or hedge that crosses the view at a slant."""
    at = _spots(parameters, rng, land, 1, 2.0)[0, :2]
    turn = np.radians(90 + rng.uniform(-65, 65))
    flat = at + np.arange(-16, 17)[:, None] * step * np.array([np.cos(turn), np.sin(turn)])
    return land.positions(*flat[np.hypot(*flat.T) > 1.5].T)


def _wire_fence(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    feet = _course(parameters, rng, land, 2.5)
    post = rod((0, 0, -0.3), (0, 0, 1.25), 0.045, 7)
    builder.mesh("fence posts", "wood-weathered", spread(post, feet, 0, 1))
    spans = np.stack([feet[:-1], feet[1:]], axis=1)
    levels = np.linspace(0.2, 1.2, int(rng.integers(2, 7)))
    runs = np.concatenate([spans + np.array([0, 0, level]) for level in levels])
    builder.mesh("fence wires", "steel-galvanised", bars(runs, 0.003, 5))


def _rail_fence(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    feet = _course(parameters, rng, land, 2.2)
    post = block((0.13, 0.13, 1.7), (0, 0, 0.55))
    builder.mesh("fence posts", "wood-dry", spread(post, feet, 0, 1))
    spans = np.stack([feet[:-1], feet[1:]], axis=1)
    runs = np.concatenate([spans + np.array([0, 0, level]) for level in (0.45, 0.85, 1.25)])
    builder.mesh("fence rails", "wood-dry", bars(runs, 0.06))


def _wall(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """A wall of dry stones."""
    feet = _course(parameters, rng, land, 1.2)
    t = rng.uniform(0, 1, (len(feet) - 1, 40, 1))
    line = feet[:-1, None] + t * np.diff(feet, axis=0)[:, None]
    line += rng.normal(0, 0.12, line.shape) * (1, 1, 0)
    line[..., 2] += rng.uniform(0, 0.9, line.shape[:2])
    stones = line.reshape(-1, 3)
    builder.mesh("wall", "rock-limestone",
               scattered_rocks(rng, stones, rng.uniform(0.25, 0.6, len(stones))))  # fmt: skip


_FENCES: dict[
    str, Callable[[SceneBuilder, FieldParameters, np.random.Generator, Terrain], None]
] = {"none": _no_fence, "wire": _wire_fence, "rails": _rail_fence, "wall": _wall}


def _bales(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Round bales 1.4 m across, some wrapped in film, or stacks of square ones."""
    if not parameters.bales:
        return
    positions = _spots(parameters, rng, land, parameters.bales, 5.0)
    turns = rng.uniform(0, 360, len(positions))
    if rng.random() < 0.6:
        bale = rod((0, -0.6, 0.66), (0, 0.6, 0.66), 0.7, 28)
        material = str(rng.choice(["leaves-dry", "leaves-dry", "polyethylene-film"]))
    else:
        sizes = (2.2, 0.9, 0.8)
        stack = [
            block(sizes, (0.1 * k, 0.95 * s, 0.4 + 0.82 * k))
            for k in range(3)
            for s in (0, 1)
            if s + k < 3
        ]
        bale, material = union(stack), "leaves-dry"
    builder.mesh("bales", material, spread(bale, positions, turns, 1))


def _herd(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    if parameters.animals == "none":
        return
    positions = _spots(parameters, rng, land, parameters.herd, 4.0)
    for number in range(min(3, len(positions))):
        own = positions[number::3]
        turns, scales = rng.uniform(0, 360, len(own)), rng.uniform(0.8, 1.1, len(own))
        mesh = spread(animal(rng, parameters.animals), own, turns, scales)
        builder.mesh(f"{parameters.animals} {number + 1}", COATS[parameters.animals], mesh)


def _machine(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Add a tractor, a car or van, or an irrigator on wheels; and a person."""
    spot = _spots(parameters, rng, land, 1, 2.5)[0] + (1.0, 0, 0)
    spot[2] = land.height(*spot[:2])
    turn = (0.0, 0.0, float(rng.uniform(0, 360)))
    if parameters.machine == "tractor":
        add_tractor(builder, tuple(spot), turn)
    elif parameters.machine in ("car", "van"):
        (add_car if parameters.machine == "car" else add_van)(builder, tuple(spot), turn)
    elif parameters.machine == "irrigation":
        _irrigation(builder, rng, land, spot)
    if parameters.person == "person":
        stands = _spots(parameters, rng, land, 1, 2.5)[0]
        add_worker(builder, tuple(stands), (0, 0, rng.uniform(0, 360)), "cotton-white", "burlap")


def _irrigation(
    builder: SceneBuilder, rng: np.random.Generator, land: Terrain, spot: Floats
) -> None:
    """Spans of pipe on trusses between towers on wheels, with hoses that hang down."""
    turn = np.radians(rng.uniform(30, 150))
    step = 12.0 * np.array([np.cos(turn), np.sin(turn)])
    towers = spot[:2] + np.arange(-2, 4)[:, None] * step
    high = rng.uniform(3.0, 4.2)
    feet = land.positions(*towers.T)
    along = np.array([step[0], step[1], 0]) / 12
    side = np.array([-along[1], along[0], 0])
    up = np.array([0, 0, high])
    segments = [[foot + s * 1.8 * along, foot + up] for foot in feet for s in (-1, 1)]
    segments += [[foot - 1.8 * along, foot + 1.8 * along] for foot in feet]
    hoses = []
    for a, b in pairwise(feet):
        for t in np.linspace(0, 1, 9)[:-1]:
            p, q = (a + u * (b - a) + up for u in (t, t + 0.125))
            low = np.array([0, 0, -0.6 * np.sin(np.pi * min(t + 0.06, 0.94)) - 0.1])
            segments += [[p, p + 0.4 * side + low], [p + 0.4 * side + low, q]]
            hoses.append([p, p - (0, 0, 0.55 * high)])
    pipes = np.stack([feet[:-1], feet[1:]], axis=1) + up
    axles = np.concatenate([feet + s * 1.8 * along for s in (-1, 1)]) + np.array([0, 0, 0.5])
    wheels = [rod(axle - 0.12 * side, axle + 0.12 * side, 0.5, 16) for axle in axles]
    builder.mesh(
        "irrigation pipe",
        "steel-galvanised",
        union([bars(pipes, 0.09, 8), bars(segments, 0.03, 5)]),
    )
    builder.mesh("irrigation hoses", "polyethylene-black", bars(hoses, 0.012, 5))
    builder.mesh("irrigation wheels", "rubber-black", union(wheels))


def _plants(
    builder: SceneBuilder, parameters: FieldParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Bushes, trees, mole hills and a heap of stones."""
    if parameters.bushes:
        positions = _spots(parameters, rng, land, parameters.bushes, 6.0) - (0, 0, 0.2)
        body, foliage = clipped_bush(rng, rng.uniform(0.8, 1.8, 3), 0.09, 900)
        bush = union([body.apply_scale(0.8), foliage])
        turns, scales = rng.uniform(0, 360, len(positions)), rng.uniform(0.4, 1.5, len(positions))
        builder.mesh("bushes", "leaves-green", spread(bush, positions, turns, scales))
    spots = in_view(rng, land, parameters.trees, max(9.0, parameters.nearest_m + 4), 120)
    kinds = [str(kind) for kind in rng.permutation(sorted(TREES))[:2]]
    add_wood(builder, "tree", kinds, "leaves-green", rng, spots, rng.uniform(3, 14))
    mounds = icosphere(2, 0.4).apply_scale((1, 1, 0.5))
    positions = _spots(parameters, rng, land, int(rng.integers(1, 12)), 4.0)
    sizes = rng.uniform(0.3, 1.2, len(positions))
    builder.mesh("mole hills", "soil-dry", spread(mounds, positions, 0, sizes))


FAMILY = Family(
    "An open field: poles, fences, bales, bushes, animals and machines, far hills",
    FieldParameters,
    build,
    min_spots=0,
)
