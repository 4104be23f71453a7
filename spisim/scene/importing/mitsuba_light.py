"""Media and emitters of Mitsuba scenes, as far as a scene file can say them.

Mitsuba knows neither 1550 nm nor, in scenes of colours, a unit of light. Of a spectrum the value
of its longest wavelength is taken, of a colour its red, which is nearest. How bright daylight is
stays open, but where it comes from is taken.
"""

from typing import Any

import numpy as np

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.scene.importing.mitsuba_file import Node
from spisim.scene.importing.model import Content, Daylight, Haze

#: Illuminance that Mitsuba's physical sun and sky are taken for: a clear day.
SUN_KLX, SKY_KLX = 100.0, 20.0
LIGHT = ("radiance", "irradiance", "intensity")


def take_medium(node: Node, box: Floats | None, name: str, content: Content) -> None:
    """Add a medium that fills a box, `box` (4, 4) of a cube of edge 1; note what cannot be told."""
    what = f"{node.what} in {name!r:.80}"
    if node.type != "homogeneous":
        content.note(f"{what}: grids are left out; give `density` of a volume in the scene file")
        return
    extinction, albedo, g = _coefficients(node)
    told = (
        f"extinction {extinction:.4g} per unit, albedo {albedo:.4g}, g {g:.3g} (red, as at 1550 nm)"
    )
    if box is None:
        content.note(f"{what}: {told}: left out, media fill boxes here and this is none")
        return
    if not extinction > 0:
        content.note(f"{what}: has no extinction and is left out")
        return
    content.hazes.append(Haze(node.id or name, box, extinction, albedo, g))
    content.note(f"{what}: {told} is a volume of the scene file")


def _coefficients(node: Node) -> tuple[float, float, float]:
    """Extinction, albedo and mean cosine; Mitsuba's defaults where the file tells none."""
    scale = node.value("scale", 1.0)
    if "sigma_s" in node.properties or "sigma_a" in node.properties:
        scattering = _infrared(node, "sigma_s", 0.0)
        extinction = scattering + _infrared(node, "sigma_a", 0.0)
        albedo = scattering / extinction if extinction > 0 else 0.0
    else:
        extinction, albedo = _infrared(node, "sigma_t", 1.0), _infrared(node, "albedo", 0.75)
    phase = next((each for each in node.children if each.kind == "phasefunction"), None)
    g = phase.value("g", 0.8) if phase is not None and phase.type == "hg" else 0.0
    extinction *= scale
    if not (0 <= extinction < np.inf and 0 <= albedo <= 1 and -1 < g < 1):
        raise InputError(
            f"{node.what}: extinction {extinction}, albedo {albedo} and g {g} are none"
        )
    return float(extinction), float(albedo), float(g)


def take_emitter(node: Node, content: Content, shape: str | None = None) -> None:
    """Take the direction of the sun; note all other light with what the file says of it."""
    if node.type == "directional" and content.daylight is None:
        content.daylight = Daylight(0.0, _direction(node), 0.0)
        content.note(
            f"{node.what}: the sun shines from there, with {_amount(node)} of no unit, which tells "
            "no daylight: give sun_klx under `ambient` in the scene file (100 at noon)"
        )
    elif node.type in ("sunsky", "sun") and content.daylight is None:
        to_sun = node.value("sun_direction", np.array([0.0, 0.0, 1.0]))
        sky_klx = SKY_KLX if node.type == "sunsky" else 0.0
        content.daylight = Daylight(SUN_KLX, -_turned(node, to_sun), sky_klx)
        content.note(
            f"{node.what}: taken for a clear day, {SUN_KLX:g} klx of sun and {sky_klx:g} of sky"
        )
    elif node.type in ("constant", "envmap", "sky", "directional"):
        content.note(
            f"{node.what}: {_amount(node)} of no unit is left out: give sky_klx under `ambient` in "
            "the scene file (20 under a clear sky)"
        )
    else:
        where = "" if shape is None else f" on {shape!r:.80}"
        content.note(
            f"{node.what}{where}: {_amount(node)} is left out: lamps, mostly of no light at "
            "1550 nm, are not in scene files"
        )


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
        value = value.properties.get("value", default)
    if isinstance(value, bool | int | float):
        return float(value)
    if np.shape(value) == (3,):
        return float(value[0])
    raise InputError(f"{node.what}: {name} cannot be read")
