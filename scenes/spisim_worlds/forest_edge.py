"""The edge of a wood: a field before it, a tree line that recedes, and the sky above."""

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.natural import clipped_bush, scattered_rocks
from spisim_worlds.parts.plants import bush, leaves, tree, wood
from spisim_worlds.parts.shapes import Mesh, bars, moved, rod, spread, union
from spisim_worlds.parts.terrain import Terrain, hills, patchwork, terrain, waves
from spisim_worlds.parts.woods import (
    TREES,
    add_far_woods,
    add_wood,
    in_view,
    scattered_tufts,
    tree_line,
)

GROUNDS = ("grass", "soil-field", "soil-dry", "leaves-dry", "soil-wet")


class ForestEdgeParameters(Parameters):
    """The drone flies over the field and looks towards the wood, along it, or past its end."""

    drone_height_m: float = drawn_log(1.3, 9.0, "above the field")
    pitch_deg: float = drawn(-9.0, 13.0, "of the line of sight, down is positive")
    edge_m: float = drawn_log(4.5, 30.0, "along the line of sight to the wood")
    edge_angle_deg: float = drawn(-75.0, 75.0, "of the edge from square to the line of sight")
    gap_deg: float = drawn(-16.0, 16.0, "at which the wood has a gap or its end, to the left")
    gap_m: float = drawn_log(1.0, 80.0, "width of the gap")
    tree_m: float = drawn_log(4.0, 22.0, "average height of the trees")
    spacing_m: float = drawn(0.28, 0.6, "of the trees, relative to their height")
    trees: str = one_of("broad-leaved", "conifer", "mixed", "poplar", text="what grows")
    season: str = one_of("leaves-green", "leaves-dry", text="what leaves and grass are like")
    crop: str = one_of("meadow", "stubble", "bare", "tall-grass", text="on the field")
    relief_m: float = drawn(0.05, 0.8, "height of the field's waves")
    foreground: str = one_of(
        "none", "sapling", "fence", "shrubs", "lone-tree", "logs", text="what stands nearest"
    )
    foreground_m: float = drawn_log(2.0, 8.0, "to what stands nearest")
    undergrowth: int = drawn(0, 30, "bushes along the edge")
    hills_m: float = drawn(0.0, 500.0, "height of the hills behind")


def build(parameters: ForestEdgeParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene; the edge is a line across x at `edge_m`, with the wood behind it."""
    rolling, far = waves(rng, (8, 40)), hills(rng, rng.uniform(300, 900), parameters.hills_m)
    land = terrain(
        lambda x, y: parameters.relief_m * rolling(x, y) + far(x, y), ((-4, 50), (-14, 14)), 0.8
    )
    eye = land.on(0, 0, -parameters.drone_height_m)
    aim = eye[2] - 10 * np.tan(np.radians(parameters.pitch_deg))
    builder = SceneBuilder(eye, (10.0, 0.0, aim), **outdoors(rng))
    _field(builder, parameters, rng, land)
    _wood(builder, parameters, rng, land)
    add_far_woods(builder, rng, land, int(rng.integers(2, 9)), 150.0)
    _FOREGROUND[parameters.foreground](builder, parameters, rng, land)
    return builder


def _field(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Plots of several crops, furrows or tufts, stones."""
    grounds = ["grass" if parameters.season == "leaves-green" else "leaves-dry"]
    grounds += [str(kind) for kind in rng.permutation(GROUNDS)[:2] if kind not in grounds]
    land.add(builder, grounds, patchwork(rng, land, len(grounds), 6.0))
    start = max(1.5, parameters.drone_height_m / np.tan(np.radians(parameters.pitch_deg + 11)))
    if parameters.crop in ("meadow", "tall-grass"):
        tall = 0.25 if parameters.crop == "meadow" else 0.9
        tufts = scattered_tufts(rng, land, 1500, start, 8 * start, tall)
        builder.mesh("grass", parameters.season, tufts)
    elif parameters.crop == "stubble":
        builder.mesh("stubble", "leaves-dry", _stubble(rng, land, start))
    positions = in_view(rng, land, 40, start, 6 * start)
    stones = scattered_rocks(rng, positions, rng.lognormal(-1.8, 0.6, 40))
    builder.mesh("stones", "rock-granite", stones)


def _stubble(rng: np.random.Generator, land: Terrain, start: float) -> Mesh:
    """Rows of cut stalks, 0.5 m apart."""
    turn = rng.uniform(0, np.pi)
    along, across = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    x, y, _ = in_view(rng, land, 5000, start, 5 * start).T
    rows = np.round((np.stack([x, y], 1) @ across) / 0.5) * 0.5 + rng.normal(0, 0.03, len(x))
    flat = (np.stack([x, y], 1) @ along)[:, None] * along + rows[:, None] * across
    feet = land.positions(flat[:, 0], flat[:, 1], 0.02)
    tips = feet + np.column_stack([rng.normal(0, 0.05, (len(x), 2)), rng.uniform(0.1, 0.3, len(x))])
    return bars(np.stack([feet, tips], axis=1), 0.008, 3)


def _wood(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Two staggered rows of trees along the edge, a gap, and the mass of the wood behind."""
    spacing = parameters.spacing_m * parameters.tree_m
    turn = np.radians(parameters.edge_angle_deg)
    along, inward = np.array([[-np.sin(turn), np.cos(turn)], [np.cos(turn), np.sin(turn)]])
    # Where the line of sight to the gap meets the edge, measured along the edge.
    gap = parameters.edge_m * np.tan(np.radians(parameters.gap_deg) - turn)
    gap = float(np.clip(gap, -200, 200))
    rows = []
    for row in range(3):
        s = np.arange(-35, 36) * spacing + rng.uniform(-0.35, 0.35, 71) * spacing
        s += (row % 2) * spacing / 2
        free = (s < gap) | (s > gap + parameters.gap_m)
        deep = (row + rng.uniform(-0.3, 0.3, 71)) * spacing
        rows.append((s[:, None] * along + deep[:, None] * inward)[free])
    feet = np.concatenate(rows) + np.array([parameters.edge_m, 0])
    reach = np.hypot(*feet.T)
    seen = (np.abs(np.degrees(np.arctan2(feet[:, 1], feet[:, 0]))) < 18) | (reach < 6)
    clear = reach > 2.5 + 0.35 * parameters.tree_m
    feet = feet[seen & clear][:110]
    kinds = ("broad-leaved", "conifer", "poplar") if parameters.trees == "mixed" else None
    add_wood(
        builder, "tree", kinds or (parameters.trees,), parameters.season, rng,
        land.positions(feet[:, 0], feet[:, 1]), parameters.tree_m,
    )  # fmt: skip
    # The interior of the wood is a single mass behind the rows.
    start = np.array([parameters.edge_m, 0]) + 3 * spacing * inward
    lines = []
    for low, high in ((-700.0, gap), (gap + parameters.gap_m, 700.0)):
        path = start + np.array([high, (low + high) / 2, low])[:, None] * along
        near = np.hypot(*(start + low * along)) < 700 or np.hypot(*(start + high * along)) < 700
        if near and high - low > 5:
            lines.append(tree_line(rng, land, path, parameters.tree_m, 60.0))
    builder.mesh("wood behind", "vegetation-canopy", union(lines))
    _undergrowth(builder, parameters, rng, land, along)


def _undergrowth(
    builder: SceneBuilder,
    parameters: ForestEdgeParameters,
    rng: np.random.Generator,
    land: Terrain,
    along: Floats,
) -> None:
    count = parameters.undergrowth
    if not count:
        return
    s = rng.uniform(-1, 1, count) * 0.35 * parameters.edge_m
    flat = s[:, None] * along + (parameters.edge_m, 0) + rng.normal(0, 0.8, (count, 2))
    flat = flat[np.hypot(*flat.T) > 3.0]
    body, foliage = clipped_bush(rng, (1.3, 1.1, 1.2), 0.1, 500)
    positions = land.positions(flat[:, 0], flat[:, 1], -0.25)
    turns, scales = rng.uniform(0, 360, len(positions)), rng.uniform(0.5, 1.6, len(positions))
    builder.mesh(
        "bushes", parameters.season, spread(union([body, foliage]), positions, turns, scales)
    )


def _nothing(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Leave the field open."""


def _place(
    parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> tuple[float, float, float]:
    """Return a position in view for a foreground object."""
    angle = np.radians(rng.uniform(-8, 8))
    distance = parameters.foreground_m
    return land.on(distance * np.cos(angle), distance * np.sin(angle), 0.05)


def _sapling(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """A young tree as high as the drone flies, its twigs across the view."""
    height = parameters.drone_height_m + rng.uniform(0.3, 2.0)
    reach = 0.25 * parameters.foreground_m + 0.5
    grown = tree(rng, height, 0.008 * height + 0.01, 22, 0.35 * height, reach)
    at = _place(parameters, rng, land)
    builder.mesh("sapling", "bark", wood(grown), at)
    foliage = leaves(rng, grown, 0.07, int(rng.integers(2, 9)))
    builder.mesh("leaves of sapling", parameters.season, foliage, at)


def _fence(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Posts and wire, or rails, that cross the view at a slant."""
    distance = max(parameters.foreground_m, 1.1 * parameters.drone_height_m)
    turn = np.radians(90 + rng.uniform(-60, 60))
    s = np.arange(-14, 15) * 2.0
    x, y = distance + s * np.cos(turn), s * np.sin(turn)
    feet = land.positions(x, y)
    feet = feet[np.hypot(x, y) > 1.5]
    wooden = rng.random() < 0.5
    post = rod((0, 0, -0.3), (0, 0, 1.3), 0.06 if wooden else 0.035, sections=7)
    builder.mesh("fence posts", "wood-weathered", spread(post, feet, 0, 1))
    levels = (0.5, 0.85, 1.15) if wooden else (0.3, 0.55, 0.8, 1.05, 1.25)
    spans = np.stack([feet[:-1], feet[1:]], axis=1)
    runs = [spans + np.array([0, 0, level]) for level in levels]
    material = "wood-weathered" if wooden else "steel-galvanised"
    builder.mesh("fence rails", material, bars(np.concatenate(runs), 0.045 if wooden else 0.003))


def _shrubs(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Bushes of twigs with and without leaves."""
    for number in range(int(rng.integers(1, 4))):
        grown = bush(rng, rng.uniform(0.8, 1.2) * min(3.0, parameters.drone_height_m + 0.3), 6, 4)
        at = _place(parameters, rng, land)
        builder.mesh(f"shrub {number + 1}", "bark", wood(grown), at)
        foliage = leaves(rng, grown, 0.06, int(rng.integers(1, 8)))
        builder.mesh(f"leaves of shrub {number + 1}", parameters.season, foliage, at)


def _lone_tree(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """A grown tree in the field, its crown in view."""
    height = parameters.drone_height_m * rng.uniform(0.9, 1.4) + 2
    x, y, _ = _place(parameters, rng, land)
    at = land.on(x + 0.3 * height, 2 * y, 0.05)
    kind = str(rng.choice(sorted(TREES)))
    add_wood(builder, "lone tree", (kind,), parameters.season, rng, [at], height)


def _logs(
    builder: SceneBuilder, parameters: ForestEdgeParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """A pile of trunks at the roadside."""
    radius = rng.uniform(0.15, 0.3)
    rows = range(int(rng.integers(2, 5)), 0, -1)
    logs = [
        rod((-2 + rng.uniform(0, 0.4), (2 * k - n) * radius, z),
            (2 + rng.uniform(0, 0.4), (2 * k - n) * radius, z), radius * rng.uniform(0.8, 1), 14)
        for level, n in enumerate(rows)
        for k in range(n)
        for z in [radius * (1 + 1.7 * level)]
    ]  # fmt: skip
    distance = max(parameters.foreground_m, 1.3 * parameters.drone_height_m) + 2.5
    at = land.on(distance, rng.uniform(-1, 1), 0.1)
    builder.mesh("logs", "bark", moved(union(logs), (0, 0, 0)), at, (0, 0, rng.uniform(20, 160)))


_FOREGROUND = {
    "none": _nothing,
    "sapling": _sapling,
    "fence": _fence,
    "shrubs": _shrubs,
    "lone-tree": _lone_tree,
    "logs": _logs,
}

FAMILY = Family(
    "A field before the edge of a wood that recedes, the sky above",
    ForestEdgeParameters,
    build,
    min_spots=0,
)
