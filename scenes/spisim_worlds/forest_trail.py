"""A trail through a forest: trunks, twigs across the way, undergrowth, a bank behind."""

import numpy as np
from trimesh.creation import icosphere

from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.placing import Ground, aside, rolling
from spisim_worlds.parts.plants import FLARE, UP, Limb, bush, grow, leaves, tree, tuft, unit, wood
from spisim_worlds.parts.shapes import Mesh, limb, union

#: Kinds of tree, bush and tuft to copy; more would make no visible difference.
TREES, BUSHES, TUFTS = 3, 3, 2
#: Radius of an average trunk; trunks differ by scale.
TREE_HEIGHT_M = 6.5


class ForestParameters(Parameters):
    """A trail that bends, with trunks close by and branches of a few millimetres across it."""

    drone_height_m: float = drawn(1.2, 2.2, "above the trail")
    trail_width_m: float = drawn(0.8, 1.8, "of the trail")
    bend_m: float = drawn(-2.0, 2.0, "how far the trail has gone to the left 10 m ahead")
    bank_m: float = drawn(5.5, 7.8, "to the foot of the wooded bank that ends the view")
    relief_m: float = drawn(0.02, 0.2, "height of the ground's waves")
    trunks: int = drawn(5, 12, "before the bank")
    trunk_mm: float = drawn(120.0, 450.0, "diameter of an average trunk at its foot")
    crossing_branches: int = drawn(1, 4, "that reach across the way")
    branch_mm: float = drawn_log(6.0, 30.0, "diameter of these where they start; they end at 3 mm")
    nearest_branch_m: float = drawn(1.6, 3.5, "to the nearest of them")
    leaves_per_twig: int = drawn(0, 7, "0 in winter")
    undergrowth: int = drawn(4, 20, "bushes and tufts of grass beside the trail")
    season: str = one_of("leaves-green", "leaves-dry", text="what leaves and grass are like")
    soil: str = one_of("soil-field", "leaves-dry", "gravel", text="of the ground")


def build(parameters: ForestParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the drone over the trail, looking along it."""
    ground = rolling(rng, parameters.relief_m, parameters.bank_m)
    eye = ground.on(0.0, 0.0, -parameters.drone_height_m)
    target = (10.0, 0.5 * parameters.bend_m, eye[2] - rng.uniform(-0.3, 0.6))
    builder = SceneBuilder(eye, target, **outdoors(rng))
    builder.mesh("ground", parameters.soil, ground.mesh((-3, parameters.bank_m + 5), (-7, 7), 0.3))
    x = np.linspace(-2, parameters.bank_m, 30)
    middle = np.column_stack([x, _bend(parameters, x)])
    trail = ground.path(middle, parameters.trail_width_m, 0.015)
    builder.mesh("trail", "soil-dry", trail)
    _trees(builder, parameters, rng, ground)
    _bank(builder, parameters, rng, ground)
    for i in range(parameters.crossing_branches):
        _crossing_branch(builder, parameters, rng, ground, i)
    _undergrowth(builder, parameters, rng, ground)
    _fallen(builder, parameters, rng, ground)
    return builder


def _bend(parameters: ForestParameters, x: float | np.ndarray) -> float | np.ndarray:
    """Return the lateral position of the middle of the trail."""
    return parameters.bend_m * (np.asarray(x) / 10) ** 2


def _trees(
    builder: SceneBuilder, parameters: ForestParameters, rng: np.random.Generator, ground: Ground
) -> None:
    """Add trees on both sides, copies of a few kinds."""
    ahead = np.linspace(2.8, parameters.bank_m + 0.5, parameters.trunks) + rng.uniform(
        -0.3, 0.3, parameters.trunks
    )
    side = rng.permutation(np.resize([-1, 1], parameters.trunks))
    off = parameters.trail_width_m / 2 + 0.25 + rng.exponential(0.5, parameters.trunks)
    beside = _bend(parameters, ahead) + side * off
    positions = list(zip(rng.uniform(0, 360, parameters.trunks), ahead, beside, strict=True))
    for kind in range(TREES):
        radius = parameters.trunk_mm / 2000 * rng.uniform(0.6, 1.4)
        placed: list[Pose] = [
            ((0, 0, turn), ground.below(x, y, 0.1, FLARE * radius))
            for turn, x, y in positions[kind::TREES]
        ]
        lowest = parameters.drone_height_m + rng.uniform(-0.6, 0.6)
        grown = tree(rng, TREE_HEIGHT_M, radius, 6, lowest, rng.uniform(1.0, 1.8))
        builder.mesh(f"tree {kind + 1}", "bark", wood(grown), copies=placed)
        if parameters.leaves_per_twig:
            foliage = leaves(rng, grown, 0.07, parameters.leaves_per_twig)
            builder.mesh(f"leaves of tree {kind + 1}", parameters.season, foliage, copies=placed)


def _bank(
    builder: SceneBuilder, parameters: ForestParameters, rng: np.random.Generator, ground: Ground
) -> None:
    """Add trunks and bushes on the bank, which is too far away for twigs."""
    trunks = []
    for y in np.linspace(-4, 4, 10) + rng.uniform(-0.4, 0.4, 10):
        foot = ground.on(parameters.bank_m + rng.uniform(0.0, 2.5), float(y), 0.5)
        radius = parameters.trunk_mm / 2000 * rng.uniform(0.5, 1.2)
        trunks += grow(rng, foot, UP + rng.normal(0, 0.05, 3), TREE_HEIGHT_M + 2, radius, 0)
    builder.mesh("trunks on the bank", "bark", wood(trunks))
    positions = zip(rng.uniform(0.2, 3.0, 14), rng.permutation(np.linspace(-3, 3, 14)), strict=True)
    copies: list[Pose] = [
        ((0, 0, rng.uniform(0, 360)), ground.on(parameters.bank_m + x, y, 0.05))
        for x, y in positions
    ]
    grown = bush(rng, rng.uniform(0.7, 1.2), 4, 3)
    builder.mesh("bush on the bank", "bark", wood(grown), copies=copies)
    foliage = leaves(rng, grown, 0.08, 2 + parameters.leaves_per_twig)
    builder.mesh("leaves on the bank", parameters.season, foliage, copies=copies)


def _crossing_branch(
    builder: SceneBuilder,
    parameters: ForestParameters,
    rng: np.random.Generator,
    ground: Ground,
    i: int,
) -> None:
    """Add a sapling with a bough across the trail, about as high as the drone."""
    ahead = parameters.nearest_branch_m + 1.1 * i
    side = (-1) ** i * (1 if parameters.bend_m < 0 else -1)
    heading = np.degrees(np.arctan2(builder.look_at_m[1], builder.look_at_m[0]))
    x, y = ahead + 0.2, aside(ahead, heading + side * 14.0)
    height = builder.position_m[2] + aside(ahead, rng.uniform(-4.0, 9.0))
    start = (x, y, max(height, ground.on(x, y, -0.2)[2]))  # above the bank if it is near
    towards = unit((rng.uniform(-0.1, 0.3), -side, rng.uniform(-0.35, 0.15)))
    length = aside(ahead, rng.uniform(14.0, 22.0))
    grown = grow(rng, start, towards, length, parameters.branch_mm / 2000, 2, 4)
    path = np.array([ground.on(x, y, 0.1), start, (x, y, start[2] + 1.5)])
    stem = Limb(path, parameters.branch_mm / 1000 * np.array([1.5, 1.0, 0.5]))
    builder.mesh(f"branch across {i + 1}", "bark", wood([stem, *grown]))
    if parameters.leaves_per_twig:
        foliage = leaves(rng, grown, 0.05, max(1, parameters.leaves_per_twig // 3))
        builder.mesh(f"leaves of branch {i + 1}", parameters.season, foliage)


def _undergrowth(
    builder: SceneBuilder, parameters: ForestParameters, rng: np.random.Generator, ground: Ground
) -> None:
    """Bushes and grass, beside the trail and at the foot of the bank."""
    bushes: list[list[Pose]] = [[] for _ in range(BUSHES)]
    tufts: list[list[Pose]] = [[] for _ in range(TUFTS)]
    for n in range(parameters.undergrowth):
        x = rng.uniform(3.5, parameters.bank_m + 1.0)
        off = parameters.trail_width_m / 2 + rng.exponential(0.6)
        y = float(_bend(parameters, x)) + rng.choice([-1, 1]) * off
        placed = ((0, 0, rng.uniform(0, 360)), ground.on(x, y, 0.02))
        (bushes[n // 2 % BUSHES] if n % 2 else tufts[n // 2 % TUFTS]).append(placed)
    for kind, copies in enumerate(bushes):
        if copies:
            grown = bush(rng, rng.uniform(0.5, 1.3), 5, 3)
            builder.mesh(f"bush {kind + 1}", "bark", wood(grown), copies=copies)
            foliage = leaves(rng, grown, 0.06, 1 + parameters.leaves_per_twig)
            builder.mesh(f"leaves of bush {kind + 1}", parameters.season, foliage, copies=copies)
    for kind, copies in enumerate(tufts):
        if copies:
            grass = tuft(rng, rng.uniform(0.2, 0.5), 60)
            builder.mesh(f"grass {kind + 1}", parameters.season, grass, copies=copies)


def _fallen(
    builder: SceneBuilder, parameters: ForestParameters, rng: np.random.Generator, ground: Ground
) -> None:
    """A log beside or across the trail, and stones."""
    x = rng.uniform(4.5, 8.0)
    y = float(_bend(parameters, x))
    radius = parameters.trunk_mm / 2000 * 0.7
    one, other = (ground.on(x + d, y + 2.5 * d, -0.8 * radius) for d in (-0.5, 0.5))
    builder.mesh("fallen log", "wood-weathered", limb(one, other, radius))
    stones: list[Mesh] = []
    for _ in range(10):
        stone = icosphere(1, rng.uniform(0.05, 0.25))
        stone.vertices *= rng.uniform(0.8, 1.2, stone.vertices.shape)
        stone.vertices *= (1, 1, 0.6)
        where = rng.uniform(3.0, 9.0)
        off = rng.choice([-1, 1]) * (parameters.trail_width_m / 2 + rng.exponential(0.3))
        stones.append(
            stone.apply_translation(ground.on(where, float(_bend(parameters, where)) + off))
        )
    builder.mesh("stones", "concrete-weathered", union(stones))


FAMILY = Family(
    "A trail through a forest, twigs of a few millimetres across the way", ForestParameters, build
)
