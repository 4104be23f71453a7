"""A shelf of shiny tins, glass jars, bottles and boxes, with specular multipath."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from trimesh.transformations import rotation_matrix

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.shapes import Mesh, alike, block, lathe, rod, union

#: The metal of `aluminium-brushed`, whose roughness is here a parameter.
ALUMINIUM = {
    "eta": {850: 2.588, 905: 2.052, 940: 1.674, 1460: 1.48, 1550: 1.579},
    "k": {850: 8.169, 905: 8.257, 940: 8.608, 1460: 14.68, 1550: 15.658},
    "source": "Rakić (1995), Applied Optics 34, 4755",
}
BOARD_M = 0.02
#: Slope of the line of sight.
DOWN = 0.05
TIN_RADIUS_M, TIN_HEIGHT_M = 0.0425, 0.115
#: Corners of round objects.
SECTIONS = 14
#: Distance of objects behind the edge of the board.
SETBACK_M = 0.03


class ShelfParameters(Parameters):
    """A shelf `distance_m` ahead; `shiny` is the fraction of tins without a paper label."""

    distance_m: float = drawn_log(1.6, 3.5, "to the front of the shelf")
    height_m: float = drawn(0.9, 1.8, "of the drone above the floor")
    turn_deg: float = drawn(-25.0, 25.0, "of the shelf about the vertical")
    spacing_m: float = drawn(0.24, 0.4, "from board to board")
    depth_m: float = drawn(0.25, 0.5, "of the boards")
    filled: float = drawn(0.7, 1.0, "fraction of occupied positions")
    shiny: float = drawn(0.2, 0.9, "fraction of tins that are bare metal")
    roughness: float = drawn_log(0.08, 0.5, "of bare tins (GGX)")
    mirrors: int = drawn(0, 2, "tins polished like a mirror")
    jars: float = drawn(0.1, 0.4, "fraction of positions with glass jars")
    boards: str = one_of("steel-painted", "wood-dry", "steel-galvanised", text="of the shelf")
    lamp: float = drawn(0.65, 0.8, "how far the hanging lamp is, relative to the shelf")
    wire_mm: float = drawn_log(3.0, 8.0, "diameter of its wire")


@dataclass(frozen=True)
class Kind:
    """A kind of object on a shelf: its parts by material, its width and height in metres."""

    wide: float
    high: float
    parts: Callable[[], dict[str, Mesh]]


def build(parameters: ShelfParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the shelf in a storeroom, with a lamp before it."""
    eye = (0.0, 0.0, parameters.height_m)
    x = parameters.distance_m
    builder = SceneBuilder(
        position_m=eye, look_at_m=(x, 0, eye[2] - DOWN * x), sky_klx=rng.uniform(0.2, 2)
    )
    builder.materials = {
        "bare tin": {"bsdf": "rough-conductor", "roughness": parameters.roughness, **ALUMINIUM},
        "gloss": {
            "bsdf": "rough-plastic",
            "reflectance": 0.55,
            "roughness": 0.1,
            "source": "estimate for varnished board and bottles",
        },
    }
    builder.rectangle("floor", "concrete", (12, 8), (2, 0, 0))
    wall = x + parameters.depth_m + 0.35
    builder.box("wall", "paint-white", (0.2, 8, 4), (wall + 0.1, 0, 2))
    _add_goods(builder, parameters, _add_shelf(builder, parameters), rng)
    _add_lamp(builder, parameters, rng)
    return builder


def _add_shelf(builder: SceneBuilder, parameters: ShelfParameters) -> list[float]:
    """Boards, uprights and price rails; returns the heights of the boards' tops."""
    wide, deep = 0.6 + 0.35 * parameters.distance_m, parameters.depth_m
    middle = deep / 2
    reach = 0.25 * parameters.distance_m + parameters.spacing_m
    tops = [
        z
        for z in np.arange(0.12, parameters.height_m + reach, parameters.spacing_m).tolist()
        if z > parameters.height_m - reach - 0.1
    ]
    boards = [block((deep, wide, BOARD_M), (middle, 0, z - BOARD_M / 2)) for z in tops]
    high = tops[-1] + 0.3
    uprights = [
        block((0.035, 0.035, high), (px, py, high / 2))
        for px in (0.03, deep - 0.03)
        for py in np.linspace(-wide / 2, wide / 2, 3)
    ]
    rails = [block((0.012, wide, 0.035), (-0.006, 0, z - 0.018)) for z in tops]
    position, turn = (parameters.distance_m, 0, 0), (0, 0, parameters.turn_deg)
    builder.mesh("shelf", parameters.boards, union(boards + uprights), position, turn)
    builder.mesh("price rails", "pvc", union(rails), position, turn)
    return tops


def _add_goods(
    builder: SceneBuilder, parameters: ShelfParameters, tops: list[float], rng: np.random.Generator
) -> None:
    """Add rows of objects on every board, and some behind or upon them."""
    half = 0.3 + 0.175 * parameters.distance_m - 0.06
    poses: dict[str, list[Floats]] = {}
    for top in tops:
        y = -half
        while y < half - 0.1:
            name = _pick(parameters, rng)
            kind = KINDS[name]
            wide = kind.wide + rng.uniform(0.004, 0.02)
            position = (SETBACK_M + kind.wide / 2 + rng.uniform(0, 0.04), y + wide / 2, top)
            y += wide
            if rng.random() > parameters.filled:
                continue
            stacked = 1 + int(rng.random() < 0.5 and 2 * kind.high < parameters.spacing_m - 0.04)
            turn = np.radians(rng.uniform(-8, 8))
            for level in range(stacked):
                at = np.add(position, (0, 0, level * kind.high))
                poses.setdefault(name, []).append(_pose(turn, at))
    shelf, turned = (parameters.distance_m, 0, 0), (0, 0, parameters.turn_deg)
    # Mirrors are difficult only near the line of sight.
    tins = sorted(poses.pop("bare tins", []), key=lambda pose: _off_axis(pose, parameters))
    mirrors, bare = tins[: parameters.mirrors], tins[parameters.mirrors :]
    if mirrors:
        goods = _posed(_tin(TIN_RADIUS_M, TIN_HEIGHT_M), np.array(mirrors))
        builder.mesh("polished tins", "aluminium-polished", goods, shelf, turned)
    if bare:
        poses["bare tins"] = bare
    for name, placed in poses.items():
        for material, mesh in KINDS[name].parts().items():
            goods = _posed(mesh, np.array(placed))
            builder.mesh(f"{name}, {material}", material, goods, shelf, turned)


def _pick(parameters: ShelfParameters, rng: np.random.Generator) -> str:
    """Draw the name of a kind by the given fractions."""
    if rng.random() < parameters.jars:
        return "jars"
    if rng.random() < 0.55:
        return "bare tins" if rng.random() < parameters.shiny else "labelled tins"
    others = ("bottles", "boxes", "flat tins", "packets")
    low = [name for name in others if KINDS[name].high < parameters.spacing_m - BOARD_M - 0.01]
    return str(rng.choice(low))


def _off_axis(pose: Floats, parameters: ShelfParameters) -> float:
    """Return the distance of a tin from the point where the line of sight meets the shelf."""
    axis_z = parameters.height_m - DOWN * parameters.distance_m
    return float(np.hypot(pose[1, 3], pose[2, 3] + TIN_HEIGHT_M / 2 - axis_z))


def _pose(angle: float, at: Floats) -> Floats:
    pose = rotation_matrix(angle, (0, 0, 1))
    pose[:3, 3] = at
    return np.asarray(pose)


def _posed(mesh: Mesh, poses: Floats) -> Mesh:
    """Copies of a mesh at poses (n, 4, 4)."""
    corners = np.einsum("nij,vj->nvi", poses[:, :3, :3], mesh.vertices) + poses[:, None, :3, 3]
    return alike(corners, mesh.faces)


def _add_lamp(builder: SceneBuilder, parameters: ShelfParameters, rng: np.random.Generator) -> None:
    """An unlit bulb on a wire, off to one side of the field."""
    x = parameters.lamp * parameters.distance_m
    y = float(rng.choice((-1, 1)) * rng.uniform(0.06, 0.14)) * x
    z = parameters.height_m + float(rng.uniform(-0.02, 0.1)) * x
    builder.mesh(
        "wire", "rubber-black", rod((x, y, z + 0.05), (x, y, 4), parameters.wire_mm / 2000, 8)
    )
    bulb = [(0, -0.03), (0.016, -0.027), (0.029, 0), (0.026, 0.015), (0.013, 0.04), (0, 0.045)]
    socket = [(0, 0.04), (0.016, 0.04), (0.016, 0.08), (0, 0.085)]
    builder.mesh("lamp bulb", "glass-painted-back", lathe(bulb, 16), (x, y, z))
    builder.mesh("lamp socket", "polypropylene", lathe(socket, 12), (x, y, z))


def _tin(radius: float, height: float) -> Mesh:
    """Tin with rims and two beads around it."""
    body = [
        (radius, 0.006), (radius, 0.3 * height), (0.97 * radius, 0.33 * height),
        (radius, 0.36 * height), (radius, 0.64 * height), (0.97 * radius, 0.67 * height),
        (radius, 0.7 * height), (radius, height - 0.006),
    ]  # fmt: skip
    rim = 1.03 * radius
    foot = [(0, 0.004), (0.93 * radius, 0.004), (0.93 * radius, 0), (rim, 0), (rim, 0.005)]
    lid = [(rim, height - 0.005), (rim, height), (0.93 * radius, height)]
    recess = [(0.93 * radius, height - 0.004), (0, height - 0.004)]
    return lathe(foot + body + lid + recess, sections=SECTIONS)


def _label(radius: float, height: float) -> Mesh:
    wide = 1.012 * radius
    low, high = 0.1 * height, 0.9 * height
    return lathe([(0, low), (wide, low), (wide, high), (0, high)], sections=SECTIONS)


def _bare_tin() -> dict[str, Mesh]:
    return {"bare tin": _tin(TIN_RADIUS_M, TIN_HEIGHT_M)}


def _labelled_tin() -> dict[str, Mesh]:
    return {
        "bare tin": _tin(TIN_RADIUS_M, TIN_HEIGHT_M),
        "paper-white": _label(TIN_RADIUS_M, TIN_HEIGHT_M),
    }


def _flat_tin() -> dict[str, Mesh]:
    return {"bare tin": _tin(0.05, 0.04)}


def _jar() -> dict[str, Mesh]:
    """Return glass as an open sheet, the content, and a lid."""
    wall = [(0.044, 0.002), (0.046, 0.01), (0.046, 0.11), (0.036, 0.13), (0.036, 0.15)]
    inside = [(0, 0.006), (0.042, 0.006), (0.043, 0.012), (0.043, 0.085), (0, 0.09)]
    lid = [(0, 0.145), (0.039, 0.145), (0.039, 0.163), (0, 0.163)]
    return {
        "glass-pane": lathe(wall, sections=SECTIONS),
        "leaves-dry": lathe(inside, sections=SECTIONS),
        "bare tin": lathe(lid, sections=SECTIONS),
    }


def _bottle() -> dict[str, Mesh]:
    body = [
        (0, 0), (0.034, 0), (0.036, 0.006), (0.036, 0.13), (0.03, 0.155), (0.014, 0.185),
        (0.014, 0.2), (0.017, 0.2), (0.017, 0.22), (0, 0.22),
    ]  # fmt: skip
    return {"gloss": lathe(body, sections=SECTIONS), "paper-white": _label(0.0362, 0.12)}


def _box() -> dict[str, Mesh]:
    return {"gloss": block((0.05, 0.12, 0.19), (0, 0, 0.095))}


def _packet() -> dict[str, Mesh]:
    return {"cardboard": block((0.07, 0.1, 0.13), (0, 0, 0.065))}


KINDS = {
    "bare tins": Kind(0.0876, TIN_HEIGHT_M, _bare_tin),
    "labelled tins": Kind(0.0876, TIN_HEIGHT_M, _labelled_tin),
    "flat tins": Kind(0.103, 0.04, _flat_tin),
    "jars": Kind(0.092, 0.163, _jar),
    "bottles": Kind(0.074, 0.22, _bottle),
    "boxes": Kind(0.12, 0.19, _box),
    "packets": Kind(0.1, 0.13, _packet),
}

FAMILY = Family(
    "A shelf of shiny tins, glass jars, bottles and boxes in a storeroom", ShelfParameters, build
)
