"""A racing course for drones: square, round and arched gates, flags, a net behind."""

from collections.abc import Callable

import numpy as np
from trimesh.creation import torus

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.placing import aside, rolling
from spisim_worlds.parts.props import cone
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import Mesh, block, grid_mesh, lathe, rod, tube, union

KINDS = ("square", "round", "arch")
#: Distance from the net to the backdrop.
NET_M = 1.1


class GatesParameters(Parameters):
    """Gates in a row; the drone is before the first and sees the others through it."""

    venue: str = one_of("hall", "field", text="indoors before a wall, or outdoors before a bank")
    drone_height_m: float = drawn(1.2, 1.8, "above the ground")
    gates: int = drawn(2, 4, "in a row")
    first_gate: str = one_of(*KINDS, text="the others follow in turn")
    first_m: float = drawn(2.6, 4.0, "to the first gate")
    spacing_m: float = drawn(1.5, 2.2, "between gates")
    opening_m: float = drawn(0.7, 1.3, "of the gates")
    border_m: float = drawn(0.06, 0.2, "width of their frames")
    turn_deg: float = drawn(0.0, 35.0, "by which gates are turned, either way")
    flags: int = drawn(1, 4, "beside the course")
    net_mm: float = drawn(2.0, 5.0, "diameter of the cords of the net behind")
    net_mesh_m: float = drawn(0.08, 0.2, "distance of its cords")
    bunting_mm: float = drawn_log(3.0, 12.0, "diameter of a cord with pennants over the course")
    backdrop_m: float = drawn(7.2, 9.2, "to wall or bank")
    cloth: str = one_of("polyester-fabric", "pvc", "cotton-white", text="of the gates")


def build(parameters: GatesParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scene with the course along x."""
    eye = (0.0, 0.0, parameters.drone_height_m)
    target = (parameters.backdrop_m, 0.0, eye[2] + rng.uniform(-0.4, 0.2))
    builder = SceneBuilder(eye, target)
    _VENUES[parameters.venue](builder, parameters, rng)
    _gates(builder, parameters, rng)
    _net(builder, parameters)
    _flags(builder, parameters, rng)
    _bunting(builder, parameters, rng)
    _on_the_ground(builder, parameters, rng)
    return builder


def _hall(builder: SceneBuilder, parameters: GatesParameters, rng: np.random.Generator) -> None:
    """Floor with lines, walls, wall bars and a mat; light from above."""
    x = parameters.backdrop_m
    builder.sky_klx = rng.uniform(1.0, 5.0)
    builder.rectangle("hall floor", "wood-dry", (x + 4, 14), (x / 2 - 1, 0, 0))
    lines = [block((0.05, 12, 0.004), (d, 0, 0.002)) for d in (3.0, 6.0, 9.0)]
    builder.mesh("floor lines", "paint-black", union(lines))
    builder.box("end wall", "plasterboard", (0.2, 14, 6), (x + 0.1, 0, 3))
    bars = [rod((x - 0.1, -0.45, z), (x - 0.1, 0.45, z), 0.018, sections=8)
            for z in np.arange(0.3, 2.6, 0.16)]  # fmt: skip
    bars += [block((0.1, 0.04, 2.6), (x - 0.06, y, 1.3)) for y in (-0.45, 0.45)]
    copies: list[Pose] = [((0, 0, 0), (0, y, 0)) for y in (-1.5, -0.5, 0.5, 1.5)]
    builder.mesh("wall bars", "wood-weathered", union(bars), copies=copies)


def _field(builder: SceneBuilder, parameters: GatesParameters, rng: np.random.Generator) -> None:
    """Ground with a bank behind, in daylight."""
    light = outdoors(rng)
    builder.sky_klx, builder.sun_klx = light["sky_klx"], light.get("sun_klx", 0.0)
    builder.sun_direction = light.get("sun_direction", builder.sun_direction)
    ground = rolling(rng, 0.03, parameters.backdrop_m - 1.0, 1.2, 6.0)
    builder.mesh(
        "ground", "leaves-green", ground.mesh((-3, parameters.backdrop_m + 6), (-8, 8), 0.3)
    )


_VENUES: dict[str, Callable[[SceneBuilder, GatesParameters, np.random.Generator], None]] = {
    "hall": _hall,
    "field": _field,
}


def _gates(builder: SceneBuilder, parameters: GatesParameters, rng: np.random.Generator) -> None:
    """Add gates alternately left and right of the axis, so that their frames are in view."""
    first = KINDS.index(parameters.first_gate)
    side = rng.choice([-1, 1])
    for i in range(parameters.gates):
        x = parameters.first_m + i * parameters.spacing_m
        if x > parameters.backdrop_m - 1.2:
            break
        kind = KINDS[(first + i) % len(KINDS)]
        to_frame = (parameters.opening_m + parameters.border_m) / 2
        off = to_frame - aside(x, rng.uniform(1.0, 7.0))
        position = (x, side * max(0.0, off), parameters.drone_height_m + rng.uniform(-0.15, 0.15))
        side = -side
        turn = (0, 0, rng.uniform(-1, 1) * parameters.turn_deg)
        gate = _GATES[kind](parameters.opening_m, parameters.border_m)
        builder.mesh(f"{kind} gate {i + 1}", parameters.cloth, gate, position, turn)
        stand = _stand(kind, parameters.opening_m, parameters.border_m, position[2])
        builder.mesh(f"stand of gate {i + 1}", "aluminium-anodised", stand, position, turn)


def _square(opening: float, border: float) -> Mesh:
    """Four panels about the origin, in the plane x = 0."""
    whole, middle = opening + 2 * border, (opening + border) / 2
    level = [block((0.05, whole, border), (0, 0, z)) for z in (-middle, middle)]
    upright = [block((0.05, border, opening), (0, y, 0)) for y in (-middle, middle)]
    return union(level + upright)


def _round(opening: float, border: float) -> Mesh:
    """An inflated ring."""
    ring = torus((opening + border) / 2, border / 2, major_sections=48, minor_sections=14)
    ring.apply_transform(np.array([[0, 0, 1.0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]))
    return ring


def _arch(opening: float, border: float) -> Mesh:
    """An inflated half ring on two legs, its middle at the origin."""
    radius = (opening + border) / 2
    bend = np.linspace(0, np.pi, 25)
    over = [(0, radius * np.cos(a), 0.15 * opening + radius * np.sin(a)) for a in bend]
    low = -0.6 * opening
    return tube([(0, radius, low), *over, (0, -radius, low)], border / 2, 14)


_GATES: dict[str, Callable[[float, float], Mesh]] = {
    "square": _square,
    "round": _round,
    "arch": _arch,
}


def _stand(kind: str, opening: float, border: float, height: float) -> Mesh:
    """Poles down to the ground and feet, seen from the middle of a gate `height` above it."""
    across = (opening + border) / 2 if kind != "round" else 0.15
    top = {"square": -opening / 2, "round": -(opening + 0.5 * border) / 2, "arch": -0.55 * opening}
    parts = []
    for y in (-across, across):
        parts.append(rod((0, y, -height), (0, y, top[kind]), 0.016, sections=8))
        parts.append(block((0.5, 0.05, 0.03), (0, y, 0.02 - height)))
    return union(parts)


def _net(builder: SceneBuilder, parameters: GatesParameters) -> None:
    """Safety net before the backdrop, between poles."""
    x, high, half = parameters.backdrop_m - NET_M, 3.6, 3.2
    thick, step = parameters.net_mm / 2000, parameters.net_mesh_m
    cords = [tube([(x, y, 0.05), (x, y, high)], thick, 4) for y in np.arange(-half, half, step)]
    cords += [tube([(x, -half, z), (x, half, z)], thick, 4) for z in np.arange(0.05, high, step)]
    builder.mesh("net", "polyester-fabric", union(cords))
    poles = [rod((x, y, -0.1), (x, y, high + 0.1), 0.03, sections=10) for y in (-half, 0.9, half)]
    top = tube(hanging((x, -half, high), (x, half, high), 0.03, 9), 0.004, 5)
    builder.mesh("net poles", "steel-galvanised", union([*poles, top]))


def _flags(builder: SceneBuilder, parameters: GatesParameters, rng: np.random.Generator) -> None:
    """Feather flags: a bent thin pole with a waving cloth, on a cross foot."""
    for i in range(parameters.flags):
        x = rng.uniform(3.0, parameters.backdrop_m - 1.6)
        y = (-1) ** i * aside(x, rng.uniform(3.0, 9.0))
        turn = (0, 0, rng.uniform(0, 360))
        tall = rng.uniform(1.8, 2.8)
        pole = _pole_line(tall)
        thin = np.linspace(0.014, 0.004, len(pole))
        feet = [block((0.7, 0.05, 0.03), (0, 0, 0.02)), block((0.05, 0.7, 0.03), (0, 0, 0.02))]
        builder.mesh(f"flag pole {i + 1}", "steel-painted", union([tube(pole, thin, 8), *feet]),
                   (x, y, 0), turn)  # fmt: skip
        builder.mesh(f"flag {i + 1}", "polyester-fabric", _cloth(pole, rng), (x, y, 0), turn)


def _pole_line(tall: float) -> Floats:
    """Return a line straight up, then bent over to +y."""
    t = np.linspace(0, 1, 16)
    return np.column_stack([0 * t, 0.45 * np.clip(t - 0.6, 0, 1) ** 2 * 6 * tall / 2.4, tall * t])


def _cloth(pole: Floats, rng: np.random.Generator) -> Mesh:
    """Waving sheet between the upper part of a pole and its own edge, wide above, narrow below."""
    edge = pole[4:]
    t = np.linspace(0, 1, 8)
    height = np.linspace(0, 1, len(edge))[:, None]
    wide = (0.25 + 0.25 * height) * (1 - 0.3 * height**4)
    grid = np.repeat(edge[:, None, :], len(t), axis=1)
    grid[..., 1] += wide * t
    grid[..., 0] += 0.05 * np.sin(2.5 * np.pi * t + 4 * height + rng.uniform(0, 6)) * t
    return grid_mesh(grid)


def _bunting(builder: SceneBuilder, parameters: GatesParameters, rng: np.random.Generator) -> None:
    """A cord across the course, from pole to pole, with triangles of cloth."""
    x = parameters.first_m + 0.5 * parameters.spacing_m
    z = parameters.drone_height_m + aside(x, rng.uniform(0.0, 7.0))
    line = hanging((x - 0.4, -3.0, z + 0.35), (x + 0.4, 3.0, z + 0.35), 0.35, 61)
    builder.mesh("cord", "cotton-white", tube(line, parameters.bunting_mm / 2000, 6))
    pennants = []
    for left, right in zip(line[:-2:3], line[2::3], strict=True):
        tip = (left + right) / 2 - (rng.uniform(-0.04, 0.04), 0, 0.22)
        pennants.append(Mesh([left, right, tip], [[0, 1, 2]], process=False))
    builder.mesh("pennants", "polyester-fabric", union(pennants))
    poles = [rod((end[0], end[1], -0.1), end, 0.02, sections=8) for end in (line[0], line[-1])]
    builder.mesh("bunting poles", "wood-dry", union(poles))


def _on_the_ground(
    builder: SceneBuilder, parameters: GatesParameters, rng: np.random.Generator
) -> None:
    """Cones that mark the course, and a landing pad."""
    cones: list[Pose] = []
    for x in np.arange(3.0, parameters.backdrop_m - 1.3, 1.6):
        y = rng.choice([-1, 1]) * aside(x, rng.uniform(2.0, 9.0))
        cones.append(((0, 0, rng.uniform(0, 90)), (x, y, 0.0)))
    builder.mesh("cone", "pvc", cone(), copies=cones)
    pad = lathe([(0, 0), (0.45, 0), (0.45, 0.02), (0, 0.02)], sections=32)
    x = min(rng.uniform(6.0, 8.0), parameters.backdrop_m - NET_M - 0.5)
    builder.mesh("landing pad", "rubber-black", pad, (x, 0.0, 0.0))


FAMILY = Family(
    "Racing gates in a row, flags, pennants on a cord and a net behind", GatesParameters, build
)
