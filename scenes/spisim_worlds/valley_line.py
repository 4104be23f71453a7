"""A line across a valley: conductors, or the rope of a cable car, from slope to slope."""

from collections.abc import Callable

import numpy as np
from trimesh.creation import icosphere

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.lattice import boom
from spisim_worlds.parts.natural import scattered_rocks
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import Mesh, bars, block, lathe, moved, rod, spread, union
from spisim_worlds.parts.terrain import Terrain, patchwork, terrain, waves
from spisim_worlds.parts.woods import TREES, add_far_woods, add_wood, in_view

#: Distance between spacers of a bundle.
SPACERS_M, BUNDLE_M = 18.0, 0.4


class ValleyLineParameters(Parameters):
    """The drone flies beside the near support or under the line, and looks over the valley."""

    line: str = one_of("conductors", "bundles", "ropeway", "chairlift", text="what is carried")
    support: str = one_of("pylon", "portal", "mast", text="on the near slope")
    support_m: float = drawn_log(2.5, 18.0, "along the line of sight to the support")
    support_deg: float = drawn(-12.0, 12.0, "at which it is seen, to the left")
    line_deg: float = drawn(-70.0, 70.0, "of the line to the line of sight")
    wires: int = drawn(1, 6, "conductors, or ropes, side by side")
    spread_m: float = drawn(0.8, 3.5, "between these")
    wire_mm: float = drawn_log(12.0, 60.0, "diameter")
    height_m: float = drawn(5.0, 25.0, "of the wires at the support above the ground")
    above_m: float = drawn(-3.5, 3.5, "how much higher than the wires the drone flies there")
    span_m: float = drawn(150.0, 900.0, "to the support on the far slope")
    sag: float = drawn(0.01, 0.06, "of the wires, relative to the span")
    pitch_deg: float = drawn(-4.0, 16.0, "of the line of sight, down is positive")
    slope_deg: float = drawn(8.0, 38.0, "of the ground down to the valley")
    depth_m: float = drawn(40.0, 300.0, "of the valley")
    far_m: float = drawn(50.0, 700.0, "height of the far slope above the valley")
    trees: int = drawn(0, 40, "on the near slope")
    balls: str = one_of("none", "balls", "dampers", text="on the wires")


def build(parameters: ValleyLineParameters, rng: np.random.Generator) -> SceneBuilder:
    """The near slope falls ahead; the drone is above z = 0."""
    land = _valley(parameters, rng)
    angle = np.radians(parameters.support_deg)
    foot = parameters.support_m * np.array([np.cos(angle), np.sin(angle)])
    top = float(land.height(*foot)) + parameters.height_m
    eye = (0.0, 0.0, max(top + parameters.above_m, float(land.height(0, 0)) + 2.0))
    aim = (10.0, 0.0, eye[2] - 10 * np.tan(np.radians(parameters.pitch_deg)))
    builder = SceneBuilder(eye, aim, **outdoors(rng))
    grounds = [str(kind) for kind in rng.permutation(
        ["grass", "rock-limestone", "soil-field", "gravel", "leaves-dry"])[:3]]  # fmt: skip
    land.add(builder, grounds, patchwork(rng, land, 3, 8.0))
    _support(builder, parameters, land, foot, top)
    _line(builder, parameters, rng, land, foot, top)
    _slopes(builder, parameters, rng, land)
    return builder


def _valley(parameters: ValleyLineParameters, rng: np.random.Generator) -> Terrain:
    """A slope, the bottom, the far slope, and hills; the valley runs across, at a slant."""
    rolling, hilly = waves(rng, (12, 60)), waves(rng, (400, 3000))
    fall = np.tan(np.radians(parameters.slope_deg))
    across = np.radians(rng.uniform(-35, 35))
    edge = rng.uniform(-4, 0.8 * parameters.support_m)
    bottom = parameters.depth_m / fall
    wide = max(0.35 * parameters.span_m, 40)

    def relief(x: Floats, y: Floats) -> Floats:
        s = x * np.cos(across) + y * np.sin(across) - edge
        # Smooth maximum of the slopes: log of a sum of exponentials.
        soft = 6.0 * fall
        near = -soft * np.logaddexp(0, np.clip(s * fall / soft, -700, 700))
        near = np.maximum(near, -parameters.depth_m)
        beyond = np.clip(s - bottom - wide, 0, None)
        far = parameters.far_m * np.tanh(beyond * 0.6 / parameters.far_m)
        far = far * (1 + 0.5 * hilly(x, y)) + 0.04 * parameters.far_m * rolling(x / 6, y / 6)
        return near + 0.5 * rolling(x, y) + np.where(beyond > 0, far, 0)

    return terrain(relief, ((-6, 60), (-16, 16)), 1.0)


def _along(parameters: ValleyLineParameters) -> Floats:
    """Unit vector (2,) of the line, away from the drone."""
    angle = np.radians(parameters.line_deg)
    return np.array([np.cos(angle), np.sin(angle)])


def _offsets(parameters: ValleyLineParameters) -> Floats:
    """Return offsets of the wires (n,) from the middle of the support, across the line."""
    n = parameters.wires
    return np.asarray(parameters.spread_m * (np.arange(n) - (n - 1) / 2))


def _support(
    builder: SceneBuilder, parameters: ValleyLineParameters, land: Terrain, foot: Floats, top: float
) -> None:
    """Add the support, with a cross-arm as wide as the wires."""
    base = float(land.height(*foot)) - 1.5
    reach = float(np.abs(_offsets(parameters)).max()) + 0.4
    along = np.array([*_along(parameters), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    low, high = np.array([*foot, base]), np.array([*foot, top + 0.6])
    left, right = high - reach * across, high + reach * across
    panels = max(3, int((top - base) / 1.6))
    if parameters.support == "pylon":
        body = boom(
            low, high + np.array([0, 0, 1.5]), (0.1 * (top - base) + 0.3, 0.35), panels, 0.06
        )
        arms = [boom(high, tip, (0.35, 0.06), 4, 0.035) for tip in (left, right)]
        mesh = union([body, *arms])
    elif parameters.support == "portal":
        legs = [
            boom(low + way * 0.7 * reach * across, high + way * 0.7 * reach * across,
                 (0.5, 0.25), panels, 0.05)
            for way in (-1, 1)
        ]  # fmt: skip
        mesh = union([*legs, boom(left, right, (0.3, 0.3), max(4, int(2 * reach)), 0.05)])
    else:
        pole = lathe([(0, 0), (0.4, 0), (0.22, top - base + 1.2), (0, top - base + 1.2)], 16)
        mesh = union([moved(pole, low), bars([(left, right)], 0.15, 4)])
    builder.mesh("support", "steel-galvanised", mesh)


def _line(
    builder: SceneBuilder, parameters: ValleyLineParameters, rng: np.random.Generator,
    land: Terrain, foot: Floats, top: float,
) -> None:  # fmt: skip
    """Add wires both ways from the support, fittings, loads, and the far support."""
    along = _along(parameters)
    across = np.array([-along[1], along[0]])
    far_foot = foot + parameters.span_m * along
    far_top = float(land.height(*far_foot)) + parameters.height_m
    back_foot = foot - 0.4 * parameters.span_m * along
    back_top = float(land.height(*back_foot)) + parameters.height_m
    sag = parameters.sag * parameters.span_m
    paths: list[Floats] = []
    hangers: list[Floats] = []
    cables = parameters.line in ("ropeway", "chairlift")
    drop = 0.0 if cables else rng.uniform(0.4, 2.5)
    bundle = [(-BUNDLE_M / 2, 0.0), (BUNDLE_M / 2, 0.0)]
    for offset in _offsets(parameters):
        for side, lift in bundle if parameters.line == "bundles" else [(0.0, 0.0)]:
            at, far, back = (
                np.array([*(position + (offset + side) * across), z - drop + lift])
                for position, z in ((foot, top), (far_foot, far_top), (back_foot, back_top))
            )
            paths += [_dense(at, far, sag, foot), _dense(at, back, 0.3 * sag, foot)]
        hangers.append(np.array([*(foot + offset * across), top + 0.5]))
    radius = parameters.wire_mm / 2000
    segments = np.concatenate([np.stack([path[:-1], path[1:]], axis=1) for path in paths])
    builder.mesh(
        "wires", "steel-galvanised" if cables else "aluminium-rough", _open(segments, radius)
    )
    positions = np.array(hangers)
    if cables:
        wheel = rod((0, -0.06, 0), (0, 0.06, 0), 0.25, 16)
        sheaves = union([moved(wheel.copy(), (x, 0, -0.2)) for x in (-0.6, 0, 0.6)])
        builder.mesh(
            "sheaves",
            "steel-painted",
            spread(sheaves, positions - (0, 0, 0.55), parameters.line_deg, 1),
        )
        _CABINS[parameters.line](
            builder, rng, [paths[2 * k] for k in range(parameters.wires)], foot
        )
    else:
        n = max(2, round(drop / 0.15))
        discs = lathe(
            [
                (0.02, -drop),
                *(
                    (r, -drop + drop * (k + d) / n)
                    for k in range(n)
                    for r, d in ((0.03, 0.1), (0.13, 0.3), (0.13, 0.42), (0.03, 0.9))
                ),
                (0.02, 0.1),
            ],
            12,
        )
        builder.mesh("insulators", "glass-painted-back", spread(discs, positions, 0, 1))
        if parameters.line == "bundles":
            _spacers(builder, paths)
        _fittings(builder, parameters, rng, paths, foot)
    pylon = boom(
        (*far_foot, far_top - parameters.height_m - 2),
        (*far_foot, far_top + 2),
        (2.5, 0.5),
        8,
        0.15,
    )
    builder.mesh("far support", "steel-galvanised", pylon)


def _dense(start: Floats, end: Floats, sag: float, near: Floats) -> Floats:
    """Wire between two supports, with more points near the first one."""
    fine = hanging(start, end, sag, 2001)
    return fine[np.unique(np.round(2000 * np.linspace(0, 1, 70) ** 2).astype(int))]


def _open(segments: Floats, radius: float) -> Mesh:
    """Return bars without end caps, because endless wires are not solids."""
    whole = bars(segments, radius, 6)
    open_ = whole.faces.reshape(len(segments), -1, 3)[:, :12].reshape(-1, 3)
    return Mesh(whole.vertices, open_, process=False)


def _spots_on(paths: list[Floats], spacing: float, low: float, high: float) -> Floats:
    """Return positions (n, 3) on wires, evenly between two distances from their start."""
    result = []
    for path in paths:
        length = np.concatenate([[0], np.linalg.norm(np.diff(path, axis=0), axis=1).cumsum()])
        at = np.arange(low, min(high, length[-1]), spacing)
        result.append(np.stack([np.interp(at, length, path[:, k]) for k in range(3)], axis=1))
    return np.concatenate(result)


def _spacers(builder: SceneBuilder, paths: list[Floats]) -> None:
    one, other = (_spots_on(paths[k::4], SPACERS_M, 3.0, 150.0) for k in (0, 2))
    builder.mesh("spacers", "rubber-black", bars(np.stack([one, other], axis=1), 0.03, 6))


def _fittings(
    builder: SceneBuilder, parameters: ValleyLineParameters, rng: np.random.Generator,
    paths: list[Floats], foot: Floats,
) -> None:  # fmt: skip
    """Add aerial marker balls, or dampers."""
    if parameters.balls == "balls":
        spots = _spots_on(paths[:1], rng.uniform(8, 35), rng.uniform(2, 8), 400)
        builder.mesh("warning balls", "polypropylene", spread(icosphere(3, 0.3), spots, 0, 1))
    elif parameters.balls == "dampers":
        spots = _spots_on(paths, 60, 0.9, 2.0)
        damper = union([bars([[(-0.25, 0, -0.1), (0.25, 0, -0.1)]], 0.008, 5),
                        rod((-0.3, 0, -0.1), (-0.17, 0, -0.1), 0.04, 8),
                        rod((0.17, 0, -0.1), (0.3, 0, -0.1), 0.04, 8),
                        block((0.04, 0.03, 0.12), (0, 0, -0.05))])  # fmt: skip
        builder.mesh("dampers", "steel-galvanised", spread(damper, spots, parameters.line_deg, 1))


def _cabins(
    builder: SceneBuilder, rng: np.random.Generator, ropes: list[Floats], foot: Floats
) -> None:
    """Gondolas with windows on hangers."""
    shell = [block((2.0, 1.8, 0.8), (0, 0, -3.4)), block((2.1, 1.9, 0.15), (0, 0, -1.75))]
    shell += [block((0.1, 0.1, 1.3), (x, y, -2.4)) for x in (-0.95, 0.95) for y in (-0.85, 0.85)]
    hanger = bars([[(0, 0, 0), (0, 0, -1.7)], [(-0.5, 0, 0), (0.5, 0, 0)]], 0.05, 8)
    panes = [block((0.02, 1.6, 1.2), (x, 0, -2.4)) for x in (-0.96, 0.96)]
    panes += [block((1.8, 0.02, 1.2), (0, y, -2.4)) for y in (-0.86, 0.86)]
    seats = block((1.6, 0.4, 0.5), (0, 0, -2.75))
    _hung(builder, rng, ropes, rng.uniform(25, 90), {
        ("cabin", "paint-gloss-green"): union(shell), ("hanger", "steel-galvanised"): hanger,
        ("cabin window", "glass-pane"): union(panes), ("seat", "wood-dry"): seats,
    })  # fmt: skip


def _chairs(
    builder: SceneBuilder, rng: np.random.Generator, ropes: list[Floats], foot: Floats
) -> None:
    """Chairs for two on bent hangers."""
    hanger = bars([[(0, 0, 0), (0.1, 0, -2.0)], [(0.1, -0.6, -2.0), (0.1, 0.6, -2.0)],
                   [(0.1, -0.6, -2), (-0.4, -0.6, -2.5)], [(0.1, 0.6, -2), (-0.4, 0.6, -2.5)]],
                  0.03, 6)  # fmt: skip
    seat = union(
        [block((0.5, 1.2, 0.05), (-0.15, 0, -2.5)), block((0.05, 1.2, 0.5), (0.1, 0, -2.25))]
    )
    _hung(builder, rng, ropes, rng.uniform(8, 25),
          {("hanger", "steel-galvanised"): hanger, ("chair", "polyethylene"): seat})  # fmt: skip


def _hung(
    builder: SceneBuilder, rng: np.random.Generator, ropes: list[Floats], spacing: float,
    parts: dict[tuple[str, str], Mesh],
) -> None:  # fmt: skip
    """Add copies of a load along ropes, none of them at the drone."""
    spots = _spots_on(ropes, spacing, rng.uniform(4, spacing), 300)
    spots = spots[np.linalg.norm(spots - np.asarray(builder.position_m), axis=1) > 6.0][:24]
    heading = np.degrees(np.arctan2(*(ropes[0][-1] - ropes[0][0])[1::-1]))
    if len(spots):
        for (name, material), mesh in parts.items():
            builder.mesh(name, material, spread(mesh, spots, heading, 1))


_CABINS: dict[str, Callable[[SceneBuilder, np.random.Generator, list[Floats], Floats], None]] = {
    "ropeway": _cabins,
    "chairlift": _chairs,
}


def _slopes(
    builder: SceneBuilder, parameters: ValleyLineParameters, rng: np.random.Generator, land: Terrain
) -> None:
    """Trees and rocks on the near slope, woods on the far one."""
    spots = in_view(rng, land, parameters.trees, 10, 120, 15)
    kinds = [str(kind) for kind in rng.permutation(sorted(TREES))[:2]]
    add_wood(builder, "tree", kinds, "leaves-green", rng, spots, rng.uniform(4, 15))
    rocks = in_view(rng, land, 60, 4, 150, 15)
    builder.mesh(
        "rocks", "rock-limestone", scattered_rocks(rng, rocks, rng.lognormal(-0.5, 0.7, 60))
    )
    add_far_woods(builder, rng, land, int(rng.integers(3, 12)), 150.0)


FAMILY = Family(
    "A power line, cable car or chairlift across a valley, far slopes behind",
    ValleyLineParameters,
    build,
    min_spots=1,
)
