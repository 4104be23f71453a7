"""Dark, shiny, thin and see-through things close ahead, most of them between the spots."""

from collections.abc import Callable

import numpy as np
from trimesh.transformations import rotation_matrix

from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.natural import blob
from spisim_worlds.parts.props import cone, drum, worker_clothes, worker_hat, worker_skin
from spisim_worlds.parts.ropes import hanging, net
from spisim_worlds.parts.shapes import Mesh, block, moved, rod, tube, union

DARK = ("ice", "water", "abs-black", "snow-old", "carbon-fibre", "paint-black", "rubber-black")
"""From the least reflectance at 1550 nm on."""
SHINY = ("aluminium-polished", "steel", "copper", "paint-gloss-black", "water-smooth")
PLAIN = ("concrete", "cardboard", "plasterboard", "polystyrene-foam", "leather", "asphalt-wet")
HALL_M = 9.0
HALF_VIEW = 0.18
"""Tangent of half the field of view."""


class CloseQuartersParameters(Parameters):
    """Things between `nearest_m` and a wall at `wall_m`; `dark` is the fraction of dark ones."""

    nearest_m: float = drawn_log(0.95, 4.0, "to the nearest thing")
    wall_m: float = drawn_log(1.5, 18.0, "to what ends the view")
    turn_deg: float = drawn(-35.0, 35.0, "of that wall about the vertical")
    wall: str = one_of("dark", "plain", "shiny", "none", text="what ends the view")
    floor: str = one_of("dark", "plain", text="what the drone flies over")
    ceiling: str = one_of("hall", "sky", text="what is above")
    height_m: float = drawn(0.7, 1.9, "of the drone above the floor")
    pitch_deg: float = drawn(-12.0, 20.0, "of the line of sight, down is positive")
    dark: float = drawn(0.0, 1.0, "fraction of things that are dark")
    things: int = drawn(0, 5, "besides the nearest")
    thin_mm: float = drawn_log(3.0, 60.0, "diameter of poles and wires")
    sky_klx: float = drawn_log(0.1, 30.0, "light of the sky")


def build(parameters: CloseQuartersParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the place with the drone at the origin, looking along x."""
    high = parameters.height_m
    builder = SceneBuilder(
        position_m=(0, 0, high),
        look_at_m=(1, 0, high - np.tan(np.radians(parameters.pitch_deg))),
        sky_klx=parameters.sky_klx,
    )
    surfaces = {"dark": DARK, "plain": PLAIN, "shiny": SHINY}
    far = parameters.wall_m + HALL_M
    builder.rectangle(
        "floor", str(rng.choice(surfaces[parameters.floor])), (2 * far, 2 * far), (0, 0, 0)
    )
    if parameters.wall != "none":
        material, turn = str(rng.choice(surfaces[parameters.wall])), (0, 0, parameters.turn_deg)
        builder.box("wall", material, (0.2, 3 * far, 8), (parameters.wall_m + 0.1, 0, 3.9), turn)
    if parameters.ceiling == "hall":
        builder.box("ceiling", str(rng.choice(PLAIN)), (2 * far, 2 * far, 0.2), (0, 0, 3.6))
    distances_m = parameters.nearest_m * np.exp(rng.exponential(0.45, parameters.things))
    for number, x in enumerate((parameters.nearest_m, *distances_m)):
        if x < parameters.wall_m - 0.3:
            kind = str(rng.choice(sorted(_KINDS)))
            shape, materials = _KINDS[kind]
            materials = materials or (DARK if rng.random() < parameters.dark else PLAIN)
            y = x * HALF_VIEW * rng.uniform(-1.1, 1.1)
            turn = (0, 0, rng.uniform(-50, 50))
            material, mesh = str(rng.choice(materials)), shape(parameters, x, rng)
            builder.mesh(f"{kind} {number + 1}", material, mesh, (x, y, 0), turn)
    return builder


def _in_view(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> float:
    """A height near that of the drone."""
    return max(0.05, parameters.height_m + x * HALF_VIEW * float(rng.uniform(-1, 1)))


def _poles(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    lean = rng.normal(0, 0.25, (int(rng.integers(1, 4)), 2))
    aside = np.cumsum(rng.uniform(0.1, 0.5, len(lean)))
    radius = parameters.thin_mm / 2000
    return union(
        [
            rod((0, y, 0), (dx, y + dy, 3.4), radius, 10)
            for y, (dx, dy) in zip(aside - aside.mean(), lean, strict=True)
        ]
    )


def _wires(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    wires = []
    for _ in range(int(rng.integers(1, 5))):
        z = _in_view(parameters, x, rng)
        start, end = ((rng.normal(0, 0.1), y, z + rng.uniform(0, 0.5)) for y in (-2.5, 2.5))
        radius = parameters.thin_mm / 2000 * rng.uniform(0.3, 1.0)
        wires.append(tube(hanging(start, end, sag=rng.uniform(0, 0.5)), radius, 6))
    return union(wires)


def _netting(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    half, high = rng.uniform(0.3, 1.5), rng.uniform(1.2, 3.0)
    corners = [(0, -half, 0.05), (0, -half, high), (0, half, high), (0, half, 0.05)]
    return net(corners, rng.uniform(0.03, 0.1), rng.uniform(0.002, 0.008), sag=0.03)


def _board(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    """On the floor or hung, beside the middle of the view."""
    half, tall = rng.uniform(0.15, 1.2), rng.uniform(0.4, 2.4)
    low = float(rng.choice([0.02, max(0.02, parameters.height_m - tall / 2)]))
    aside = float(rng.choice((-1, 1))) * half * rng.uniform(0.3, 1.0)
    return block((0.02, 2 * half, tall), (0, aside, low + tall / 2))


def _door(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    """A door ajar in its frame."""
    frame = [block((0.1, 0.06, 2.05), (0, y, 1.025)) for y in (-0.45, 0.45)]
    leaf = block((0.04, 0.84, 2.0), (0, 0.42, 1.02))
    leaf.apply_transform(rotation_matrix(rng.uniform(0, 1.9), (0, 0, 1)))
    return union([*frame, block((0.1, 0.96, 0.06), (0, 0, 2.08)), moved(leaf, (0, -0.42, 0))])


def _lump(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    """A lump, drum or cone, on the floor or hung."""
    size = float(np.exp(rng.uniform(np.log(0.08), np.log(0.7))))
    made = [blob(rng, (size, size, size), 0.15, 2), drum(), cone()][int(rng.integers(3))]
    low = rng.choice([0.01, _in_view(parameters, x, rng)])
    return moved(made, (0, 0, low - made.bounds[0, 2]))


def _person(parameters: CloseQuartersParameters, x: float, rng: np.random.Generator) -> Mesh:
    return union([worker_clothes(), worker_skin(), worker_hat()])


_KINDS: dict[str, tuple[Callable[..., Mesh], tuple[str, ...]]] = {
    "board": (_board, ()),
    "door": (_door, ()),
    "lump": (_lump, ()),
    "mirror": (_board, SHINY),
    "netting": (_netting, ()),
    "pane": (_board, ("glass-pane",)),
    "person": (_person, ()),
    "poles": (_poles, ()),
    "wires": (_wires, ()),
}
"""Shapes, and their materials where those are not dark or plain ones."""

FAMILY = Family(
    "Dark, shiny, thin and see-through things close ahead, most of them between the spots",
    CloseQuartersParameters,
    build,
    min_spots=1,
)
