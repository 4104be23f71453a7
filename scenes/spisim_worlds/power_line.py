"""An overhead power line: pole or pylon, insulators, conductors; a wooded slope or open land."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import (
    Family,
    Parameters,
    Point,
    Pose,
    SceneBuilder,
    drawn,
    drawn_log,
    one_of,
)
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.placing import Ground, aside, rolling
from spisim_worlds.parts.plants import FLARE, leaves, tree, wood
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import Mesh, block, lathe, limb, moved, rod, tube, union
from spisim_worlds.parts.terrain import hills, patchwork, terrain, waves
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view

#: Height of the cross-arm, and of the support above it.
ARM_M, PEAK_M = 9.0, 0.9
#: Bars of a lattice, and the distance between its levels.
BAR_RADIUS_M, LEVEL_M = 0.03, 0.9
#: One disc of a cap-and-pin insulator: spacing and radius of type U70BS of IEC 60305.
DISC_SPACING_M, DISC_RADIUS_M = 0.127, 0.1275
#: Rise of the slope behind per metre.
SLOPE = 2.5


class PowerLineParameters(Parameters):
    """The drone flies nearly as high as the conductors, which cross the view."""

    support: str = one_of("wooden-pole", "lattice-pylon", text="what carries the line")
    distance_m: float = drawn(3.8, 5.5, "to the support")
    support_angle_deg: float = drawn(-6.0, 6.0, "at which the support is seen, to the left")
    line_angle_deg: float = drawn(45.0, 135.0, "of the line to the line of sight")
    drone_below_m: float = drawn(0.2, 1.5, "how far below the cross-arm the drone flies")
    arm_m: float = drawn(1.6, 2.6, "length of the cross-arm")
    conductors: int = drawn(2, 4, "on the cross-arm")
    conductor_mm: float = drawn_log(8.0, 30.0, "diameter")
    span_m: float = drawn(25.0, 60.0, "between supports")
    sag_m: float = drawn(0.4, 1.8, "of the conductors at mid-span")
    discs: int = drawn(2, 6, "of each insulator")
    cable_mm: float = drawn_log(5.0, 15.0, "diameter of a service cable in front of the line")
    cable_m: float = drawn(2.0, 3.2, "to the service cable")
    equipment: str = one_of("none", "transformer", text="on a wooden pole")
    backdrop_m: float = drawn(6.6, 8.4, "to the slope behind, as high as the drone")
    trees: int = drawn(5, 10, "on the slope")
    behind: str = one_of(
        "slope", "valley", "plain", text="a slope that ends the view, or open land"
    )
    hills_m: float = drawn(0.0, 500.0, "height of the far hills, where the land is open")
    tilt_deg: float = drawn(-7.0, 9.0, "of the line of sight below the arm, where it is open")


def build(parameters: PowerLineParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the support slightly off the axis; its neighbours are out of view."""
    eye_z = ARM_M - parameters.drone_below_m
    if parameters.behind != "slope":
        return _in_the_open(parameters, rng, eye_z)
    start = parameters.backdrop_m - eye_z / SLOPE
    ground = rolling(rng, 0.15, start, SLOPE, ARM_M + 6.0)
    x = parameters.distance_m
    target_z = eye_z + rng.uniform(0.3, 0.9) * parameters.drone_below_m
    builder = SceneBuilder((0.0, 0.0, eye_z), (x, 0.0, target_z), **outdoors(rng))
    builder.mesh("ground", "soil-field", ground.mesh((-2, parameters.backdrop_m + 5), (-8, 8), 0.4))
    foot = ground.on(x, aside(x, parameters.support_angle_deg), 0.3)
    _overhead(builder, parameters, rng, foot)
    _trees(builder, parameters, rng, ground)
    return builder


def _overhead(
    builder: SceneBuilder, parameters: PowerLineParameters, rng: np.random.Generator, foot: Point
) -> None:
    """Add the support, what it carries, and the cable in front."""
    _SUPPORTS[parameters.support](builder, parameters, foot)
    _line(builder, parameters, foot)
    _service_cable(builder, parameters, rng)


def _in_the_open(
    parameters: PowerLineParameters, rng: np.random.Generator, eye_z: float
) -> SceneBuilder:
    """Add the same line over fields, or above a valley that falls away behind it."""
    x, waved = parameters.distance_m, waves(rng, (12, 60))
    far = hills(rng, rng.uniform(250, 900), parameters.hills_m)
    fall = rng.uniform(0.15, 0.6) if parameters.behind == "valley" else 0.0
    edge = x + rng.uniform(2, 10)

    def relief(along: Floats, across: Floats) -> Floats:
        down = np.minimum(fall * np.clip(along - edge, 0, None), 120.0)
        return 0.4 * waved(along, across) - down + far(along, across)

    land = terrain(relief, ((-4, 45), (-12, 12)), 0.9)
    tilt = aside(x, parameters.tilt_deg)
    builder = SceneBuilder((0.0, 0.0, eye_z), (x, 0.0, ARM_M - tilt), **outdoors(rng))
    land.add(builder, ["grass", "soil-field", "leaves-dry"], patchwork(rng, land, 3, 6.0))
    _overhead(builder, parameters, rng, land.on(x, aside(x, parameters.support_angle_deg), 0.3))
    positions = in_view(rng, land, 2 * parameters.trees, 12, 120)
    kinds = [str(kind) for kind in rng.permutation(sorted(TREES))[:2]]
    add_wood(builder, "tree", kinds, "leaves-green", rng, positions, rng.uniform(4, 14))
    add_far_woods(builder, rng, land, int(rng.integers(2, 9)), 100.0)
    return builder


def _wooden_pole(builder: SceneBuilder, parameters: PowerLineParameters, foot: Point) -> None:
    turn = (0.0, 0.0, parameters.line_angle_deg)
    height = ARM_M + PEAK_M - foot[2]
    pole = lathe([(0, 0), (0.14, 0), (0.095, height - 0.04), (0, height)], sections=14)
    builder.mesh("pole", "wood-weathered", pole, foot, turn)
    at = (foot[0], foot[1], ARM_M)
    half = parameters.arm_m / 2
    # The line runs along its x, the arm along its y; the arm is bolted to the pole's side.
    arm = block((0.1, parameters.arm_m, 0.12), (-0.13, 0, -0.06))
    braces = [
        rod((-0.13, 0, -0.75), (-0.13, side * 0.6 * half, -0.1), 0.018, sections=6)
        for side in (-1, 1)
    ]
    builder.mesh("cross-arm", "wood-weathered", arm, at, turn)
    builder.mesh("braces", "steel-galvanised", union(braces), at, turn)
    if parameters.equipment == "transformer":
        # On the drone's side, whatever the direction of the line.
        builder.mesh("transformer", "steel-painted", _transformer(), (*foot[:2], ARM_M - 1.3))
    stay = hanging((*foot[:2], ARM_M - 0.3), (foot[0] + 0.5, foot[1] - 5.0, foot[2]), 0.0, 2)
    builder.mesh("stay wire", "steel-galvanised", tube(stay, 0.006, 5))


def _transformer() -> Mesh:
    """Tank, hung on its pole at the origin towards -x, with cooling fins and two bushings."""
    x = -0.45
    tank = lathe([(0, -0.4), (0.26, -0.4), (0.26, 0.38), (0.28, 0.4), (0, 0.44)], sections=24)
    fins = [
        block((0.14, 0.012, 0.55), (x + 0.3 * np.cos(a), 0.3 * np.sin(a), 0))
        for a in np.radians((100, 120, 140, 160, 180, 200, 220, 240, 260))
    ]
    bushings = [moved(_insulator(2), (x, side * 0.13, 0.42)) for side in (-1, 1)]
    hangers = [block((0.2, 0.1, 0.05), (-0.15, 0, z)) for z in (-0.25, 0.25)]
    return union([moved(tank, (x, 0, 0)), *fins, *bushings, *hangers])


def _lattice_pylon(builder: SceneBuilder, parameters: PowerLineParameters, foot: Point) -> None:
    half = parameters.arm_m / 2
    bars: list[tuple[Point, Point]] = []
    levels = np.arange(ARM_M + PEAK_M, foot[2] - LEVEL_M, -LEVEL_M)
    for upper, lower in pairwise(levels.tolist()):
        top, bottom = _corners(upper), _corners(lower)
        for k in range(4):
            following = (k + 1) % 4
            bars += [
                (top[k], bottom[k]),
                (bottom[k], bottom[following]),
                (top[k], bottom[following]),
                (top[following], bottom[k]),
            ]
    for side in (-1, 1):
        tip = (0.0, side * half, ARM_M)
        low, high = _corners(ARM_M), _corners(ARM_M + 0.6)
        for k in (0, 3) if side < 0 else (1, 2):
            bars += [(low[k], tip), (high[k], tip)]
            bars += [
                (low[k] + f * (tip - low[k]), high[k] + f * (tip - high[k])) for f in (0.3, 0.6)
            ]
    lattice = union([rod(*bar, BAR_RADIUS_M, sections=4) for bar in bars])
    turn = (0.0, 0.0, parameters.line_angle_deg)
    builder.mesh("pylon", "steel-galvanised", lattice, (*foot[:2], 0.0), turn)


def _corners(height: float) -> Floats:
    """Return corners (4, 3) of a pylon, which widens downwards, at a height."""
    half = 0.2 + 0.06 * (ARM_M + PEAK_M - height)
    square = np.array([(-1, -1), (-1, 1), (1, 1), (1, -1)])
    return np.column_stack([half * square, np.full(4, height)])


def _insulator(discs: int) -> Mesh:
    """String of discs, upright from z = 0, with a fitting at either end."""
    top = discs * DISC_SPACING_M
    profile: list[Sequence[float]] = [(0, -0.05), (0.03, -0.05)]
    for k in range(discs):
        z = k * DISC_SPACING_M
        profile += [
            (0.035, z + 0.02),
            (DISC_RADIUS_M, z + 0.035),
            (DISC_RADIUS_M, z + 0.05),
            (0.05, z + 0.09),
            (0.035, z + 0.12),
        ]
    return lathe([*profile, (0.03, top + 0.05), (0, top + 0.05)], sections=16)


def _line(builder: SceneBuilder, parameters: PowerLineParameters, foot: Point) -> None:
    """Insulators and conductors, dampers beside each insulator, and the earth wire on top."""
    angle = np.radians(parameters.line_angle_deg)
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    stands = parameters.support == "wooden-pole"
    length = parameters.discs * DISC_SPACING_M + 0.05
    middle = np.array([foot[0], foot[1], ARM_M]) - 0.13 * stands * along
    # Pole-top discs stand on the arm, those of a pylon hang below it.
    turn = (0.0, 0.0, 0.0) if stands else (180.0, 0.0, 0.0)
    drop = length if stands else -length
    offsets = np.linspace(-0.48, 0.48, parameters.conductors) * parameters.arm_m
    feet = [middle + offset * across for offset in offsets]
    copies: list[Pose] = [((0, 0, 0), foot_) for foot_ in feet]
    discs = _insulator(parameters.discs).apply_scale(0.7 if stands else 1.0)
    if turn[0]:
        discs.apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))
    builder.mesh("insulator", "glass-painted-back", discs, copies=copies)
    wires, dampers = [], []
    for position in feet:
        clamp = position + np.array([0.0, 0.0, 0.7 * drop if stands else drop])
        wires.append(_both_ways(parameters, clamp, along, parameters.sag_m))
        for way in (-1, 1):
            hung = clamp + way * 0.6 * along - (0, 0, 0.07)
            dampers += [
                rod(hung - 0.2 * along, hung + 0.2 * along, 0.005, sections=5),
                limb(hung - 0.2 * along, hung - 0.13 * along, 0.02),
                limb(hung + 0.13 * along, hung + 0.2 * along, 0.02),
            ]
    radius = parameters.conductor_mm / 2000
    builder.mesh("conductors", "aluminium-rough", union([tube(w, radius, 6) for w in wires]))
    builder.mesh("dampers", "steel-galvanised", union(dampers))
    top = np.array([foot[0], foot[1], ARM_M + PEAK_M])
    earth = _both_ways(parameters, top, along, 0.7 * parameters.sag_m)
    builder.mesh("earth wire", "steel-galvanised", tube(earth, 0.006, 5))


def _both_ways(parameters: PowerLineParameters, at: Floats, along: Floats, sag_m: float) -> Floats:
    """Return a wire from the previous support, through a point of this one, to the next."""
    reach = parameters.span_m * along
    return np.vstack([hanging(at - reach, at, sag_m, 41), hanging(at, at + reach, sag_m, 41)[1:]])


def _service_cable(
    builder: SceneBuilder, parameters: PowerLineParameters, rng: np.random.Generator
) -> None:
    """Add a single thin cable across the view, in front of everything else."""
    x, z = parameters.cable_m, builder.position_m[2]
    rise = aside(x, rng.uniform(-6.0, 6.0))
    slope = rng.uniform(-0.3, 0.3)
    left, right = (x + 1.5, 8.0, z + rise + 8 * slope), (x - 0.5, -8.0, z + rise - 8 * slope)
    sagging = hanging(left, right, 0.25, 41)
    sagging[:, 2] += 0.25
    builder.mesh("service cable", "rubber-black", tube(sagging, parameters.cable_mm / 2000, 6))


def _trees(
    builder: SceneBuilder, parameters: PowerLineParameters, rng: np.random.Generator, ground: Ground
) -> None:
    """Two kinds of tree on the slope, their crowns about as high as the drone."""
    positions: list[tuple[float, float, float]] = []
    sideways = rng.permutation(np.linspace(-3.0, 3.0, parameters.trees))
    for y in sideways + rng.uniform(-0.3, 0.3, parameters.trees):
        x = parameters.backdrop_m + rng.uniform(-1.6, 0.8)
        positions.append((x, float(y), rng.uniform(0, 360)))
    for kind in range(2):
        height, radius = rng.uniform(2.5, 5.0), rng.uniform(0.05, 0.1)
        grown = tree(rng, height, radius, 10, 0.6, 1.4)
        placed: list[Pose] = [
            ((0, 0, turn), ground.below(x, y, 0.4, FLARE * radius))
            for x, y, turn in positions[kind::2]
        ]
        builder.mesh(f"tree {kind + 1}", "bark", wood(grown), copies=placed)
        foliage = leaves(rng, grown, 0.16, 8)
        builder.mesh(f"leaves of tree {kind + 1}", "leaves-green", foliage, copies=placed)


_SUPPORTS = {"wooden-pole": _wooden_pole, "lattice-pylon": _lattice_pylon}

FAMILY = Family(
    "An overhead line: pole or pylon, insulators, conductors of 8 to 30 mm, a slope or open land",
    PowerLineParameters,
    build,
    min_spots=1,
)
