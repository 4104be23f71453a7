"""Media and emitters of Mitsuba scenes, as far as a scene file can say them.

Mitsuba knows neither 1550 nm nor, in scenes of colours, a unit of light. Of a spectrum the value
of its longest wavelength is taken, of a colour its red, which is nearest. Lamps
keep their numbers.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config.linear import LINEAR
from spisim.scene.volumes import closed
from spisim_formats.library.content import Content, Daylight, Glow, Haze, Part
from spisim_formats.library.shapes import as_mesh
from spisim_formats.library.textures import Texture, linear_red
from spisim_formats.mitsuba.bounds import clipped, grid_box
from spisim_formats.mitsuba.elements import Node
from spisim_formats.mitsuba.grid import Find, is_grid, read_lattice, read_surround

#: Illuminance that Mitsuba's physical sun and sky are taken for: a clear day.
SUN_KLX, SKY_KLX = 100.0, 20.0
LIGHT = ("radiance", "irradiance", "intensity")
#: What an emitter's light is told in, and the field of a lamp that takes it.
LAMPS = {
    "area": ("radiance", "radiance_w_per_m2_sr", "W/(m² sr)"),
    "constant": ("radiance", "radiance_w_per_m2_sr", "W/(m² sr)"),
    "directional": ("irradiance", "irradiance_w_per_m2", "W/m²"),
    "point": ("intensity", "intensity_w_per_sr", "W/sr"),
    "spot": ("intensity", "intensity_w_per_sr", "W/sr"),
}
SAY = {"constant": "environment", "directional": "directional", "point": "point", "spot": "spot"}


def take_medium(node: Node, parts: Sequence[Part], boxes: Sequence[Floats | None], name: str,
                content: Content, find: Find, first: int | None = None) -> None:  # fmt: skip
    """Add a medium that fills parts of a shape, in the world; note what cannot be told.

    They are the content's from the `first` on, unless they are not seen.

    `boxes` (4, 4) of cubes of edge 1 are those of parts that are one. InputError for grids that are
    missing or damaged.
    """
    what = f"{node.what} in {name!r:.80}"
    grids = {key: read_lattice(each, find) for key, each in node.properties.items()
             if isinstance(each, Node) and is_grid(each)}  # fmt: skip
    for key in sorted(set(grids) - {"sigma_t", "albedo"}):
        content.warn(f"{what}: a grid of {key} is left out, and the medium")
        return
    for key, way in _other_ways(node, grids):
        content.note(f"{what}: its grid of {key} is {way}")
    density, brightness = grids.get("sigma_t"), grids.get("albedo")
    bounds = grid_box(node, density)
    if brightness is not None and not brightness.values.max() <= 1:
        raise InputError(f"{node.what}: its albedo is over 1")
    extinction, albedo, g = _coefficients(node, content)
    if not extinction > 0 or (density is not None and not density.values.any()):
        content.note(f"{what}: has no extinction and is left out")
        return
    maximum = extinction * (1 if density is None else float(density.values.max()))
    text = f"extinction {maximum:.4g} per unit"
    text += " at most, a grid" if density is not None else ""
    text += f", albedo {albedo:.4g}" if brightness is None else ", albedo of a grid"
    text += f", g {g:.3g} (red, as at 1550 nm)"
    for number, (part, box) in enumerate(zip(parts, boxes, strict=True)):
        within = None if first is None else first + number
        haze = Haze(node.id or name, part.to_world, extinction, albedo, g, None,
                    density, brightness, within)  # fmt: skip
        if box is not None:
            haze = replace(haze, to_world=box)
        else:
            try:
                haze = replace(haze, mesh=closed(as_mesh(part.geometry), name))
            except InputError as error:
                content.warn(f"{what}: {text}: left out, {error}")
                continue
        if bounds is not None and (cut := clipped(haze, bounds)) is not haze:
            content.note(f"{what}: it ends where its grid does, as in Mitsuba")
            if cut is None:
                continue
            haze = cut
        content.hazes.append(haze)
        content.note(f"{what}: {text} is a volume of the scene file")


def _other_ways(node: Node, grids: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Grids that Mitsuba goes on from cell to cell, and beyond the rim, otherwise than here."""
    for key in grids:
        grid = node.properties[key]
        if (between := grid.value("filter_type", "trilinear")) != "trilinear":
            yield key, f"{between} there, linear between the middles of cells here"
        if (beyond := grid.value("wrap_mode", "clamp")) != "clamp":
            yield key, f"{beyond}ed there beyond its box, here it goes on as it is at its rim"


@dataclass
class Air:
    """Media by where they are: around sensors, inside of shapes, and outside of shapes and lamps.

    In Mitsuba light starts in the medium of its sensor, and changes it where it crosses a shape.
    """

    around: list[Node] = field(default_factory=list)
    inside: set[Node] = field(default_factory=set)
    outside: list[Node] = field(default_factory=list)

    def take(self, content: Content) -> None:
        """Make fog of the medium around the first sensor; warn of those that are nowhere."""
        around = [node for node in dict.fromkeys(self.around) if node not in self.inside]
        taken = set(self.inside)
        for node in around[:1]:
            if node.type != "homogeneous":
                continue
            with content.leaving_out(node.what, node.forget):
                extinction, albedo, g = _coefficients(node, content)
                content.fog = {"extinction_per_m": extinction, "albedo": albedo, "g": g}
                content.note(
                    f"{node.what} around the sensor is the fog of the scene file: extinction "
                    f"{extinction:.4g} per unit, albedo {albedo:.4g}, g {g:.3g} (red, as at "
                    "1550 nm)"
                )
            taken.add(node)
        for node in dict.fromkeys((*around, *self.outside)):
            if node not in taken:
                node.forget()
                content.warn(
                    f"{node.what} fills space outside of shapes and is left out: give `fog` in the "
                    "scene file"
                )


def _coefficients(node: Node, content: Content) -> tuple[float, float, float]:
    """Extinction, albedo and mean cosine; Mitsuba's defaults where the file tells none."""
    scale = node.value("scale", 1.0)
    if "sigma_s" in node.properties or "sigma_a" in node.properties:
        scattering = _infrared(node, "sigma_s", 0.0)
        extinction = scattering + _infrared(node, "sigma_a", 0.0)
        albedo = scattering / extinction if extinction > 0 else 0.0
    else:
        extinction, albedo = (
            1.0 if is_grid(node.properties.get(name)) else _infrared(node, name, default)
            for name, default in (("sigma_t", 1.0), ("albedo", 0.75))
        )
    phase = next((each for each in node.children if each.kind == "phasefunction"), None)
    g = phase.value("g", 0.8) if phase is not None else 0.0
    if phase is not None and phase.type != "hg":
        g = 0.0
        if phase.type != "isotropic":
            content.note(f"{node.what}: its phase function is {phase.type} there, isotropic here")
    extinction *= scale
    if not (0 <= extinction < np.inf and 0 <= albedo <= 1 and -1 < g < 1):
        raise InputError(
            f"{node.what}: extinction {extinction}, albedo {albedo} and g {g} are none"
        )
    return float(extinction), float(albedo), float(g)


def take_emitter(node: Node, content: Content, find: Find, shape: str | None = None) -> float:
    """Take a lamp or the sun, and tell of it; return the radiance of one that is a surface.

    Numbers have no unit; they are kept as they are.
    """
    if node.type in ("sunsky", "sun") and content.daylight is None:
        to_sun = node.value("sun_direction", np.array([0.0, 0.0, 1.0]))
        sky_klx = SKY_KLX if node.type == "sunsky" else 0.0
        content.daylight = Daylight(SUN_KLX, -_turned(node, to_sun), sky_klx)
        content.note(
            f"{node.what}: taken for a clear day, {SUN_KLX:g} klx of sun and {sky_klx:g} of sky"
        )
        return 0.0
    where = "" if shape is None else f" on {shape!r:.80}"
    what = f"{node.what}{where}: {_amount(node)}"
    if node.type == "envmap":
        _take_surround(node, content, find)
        return 0.0
    if node.type not in LAMPS:
        content.note(f"{what} is left out: give `lamps` in the scene file")
        return 0.0
    quantity, field, unit = LAMPS[node.type]
    source = node.properties.get(quantity)
    picture = source if isinstance(source, Node) and source.type == "bitmap" else None
    try:
        amount = _mean_red(picture, find) if picture else _infrared(node, quantity, 1.0)
    except InputError as error:
        why = f": {error}" if picture else ", which is no number: give `lamps` in the scene file"
        content.note(f"{what} is left out{why}")
        return 0.0
    if not 0 < amount < np.inf:
        content.note(f"{what} is left out: it gives no light")
        return 0.0
    odd = "; its picture is left out" if "texture" in node.properties else ""
    odd += ", the mean of its picture's red" if picture else ""
    content.note(f"{what} has no unit; as watts {amount:.4g} {unit}{odd}")
    if node.type == "area":
        return amount
    content.glows.append(_glow(node, {"type": SAY[node.type], field: amount}))
    return 0.0


def _take_surround(node: Node, content: Content, find: Find) -> None:
    """A picture of all around."""
    scale = node.value("scale", 1.0)
    what = f"{node.what}: picture {node.value('filename', '')!r:.80}"
    try:
        picture, axes = read_surround(node, find)
    except InputError as error:
        content.note(f"{what} is left out: {error}")
        return
    if not 0 < scale < np.inf:
        content.note(f"{what} is left out: it gives no light")
        return
    brightest = scale * float(picture.max())
    content.note(f"{what} has no unit; as watts up to {brightest:.4g} W/(m² sr)")
    fields = {"type": "environment", "radiance_w_per_m2_sr": scale}
    content.glows.append(Glow(node.id or node.name or "envmap", fields, None, None, picture, axes))


def _mean_red(picture: Node, find: Find) -> float:
    """Of a picture, over all of it; InputError for one that cannot be read."""
    path = find(picture)
    if reader := LINEAR.get(path.suffix.lower()):
        return float(reader(path).mean())
    linear = picture.value("raw", False)
    return float(linear_red(Texture(path.name, path, linear=linear)).mean())


def _glow(node: Node, fields: dict[str, Any]) -> Glow:
    name = node.id or node.name or node.type
    if node.type == "constant":
        return Glow(name, fields)
    if node.type == "directional":
        return Glow(name, fields, direction=_direction(node))
    to_world = node.value("to_world", np.eye(4))
    if node.type == "point":
        return Glow(name, fields, position=node.value("position", to_world[:3, 3]))
    cutoff = node.value("cutoff_angle", 20.0)
    if not 0 < cutoff <= 90:
        raise InputError(f"{node.what}: cutoff_angle {cutoff} is not within 0 to 90")
    beam = min(node.value("beam_width", 0.75 * cutoff), cutoff)
    fields |= {"cutoff_deg": cutoff, "beam_deg": beam}
    return Glow(name, fields, to_world[:3, 3], _turned(node, np.array([0.0, 0.0, 1.0])))


def _amount(node: Node) -> str:
    """What a file says of an emitter's light."""
    for name in LIGHT:
        if name in node.properties:
            value = node.properties[name]
            numbers = np.ravel(value) if not isinstance(value, Node) else np.empty(0)
            if np.issubdtype(np.asarray(numbers).dtype, np.number) and len(numbers):
                return f"{name} {', '.join(f'{number:.4g}' for number in numbers)}"
            return f"{name} of a picture or spectrum"
    return f"light by {node.value('filename', 'default')!r:.80}"


def _direction(node: Node) -> Floats:
    if "direction" in node.properties:
        return _unit(node, node.value("direction", np.zeros(3)))
    return _turned(node, np.array([0.0, 0.0, 1.0]))


def _turned(node: Node, direction: Floats) -> Floats:
    return _unit(node, node.value("to_world", np.eye(4))[:3, :3] @ direction)


def _unit(node: Node, direction: Floats) -> Floats:
    length = float(np.linalg.norm(direction))
    if not 0 < length < np.inf:
        raise InputError(f"{node.what}: its direction is zero")
    return np.asarray(direction / length)


def _infrared(node: Node, name: str, default: float) -> float:
    """A spectrum as at 1550 nm: a number, or of a colour the red."""
    value: Any = node.properties.get(name, default)
    if isinstance(value, Node):  # a texture or volume that is the same everywhere
        value = value.properties.get("value")
    if isinstance(value, bool | int | float):
        return float(value)
    if np.shape(value) == (3,):
        return float(value[0])
    raise InputError(f"{node.what}: {name} cannot be read")
