"""Lights of a Gazebo world: the first directional one is the sun, all others are lamps.

Gazebo's light has no unit. A sun of intensity and colour 1 is taken as the noon sun on a clear day,
and `ambient` light of 1 as a clear sky, as is a `sky` alone. Lamps keep their numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim_formats.library.content import Content, Daylight, Glow
from spisim_formats.library.records import mark_all
from spisim_formats.library.units import at_a_metre, number_or
from spisim_formats.library.xml import numbers

#: SDFormat's default factors of 1 / (c + l d + q d²), and its default range.
ATTENUATION = (("constant", 1.0), ("linear", 1.0), ("quadratic", 0.0))
MAX_RANGE_M = 10.0
#: A longer range is irrelevant.
FAR_M = 100.0
#: Fraction of light left over the meteorological optical range.
LEFT_AT_MOR, TINY = 0.05, 1e-9
SUN_KLX, SKY_KLX = 100.0, 20.0
#: Fields of a lamp and units, by the type of a light.
LAMPS = {
    "point": ("intensity_w_per_sr", "W/sr"),
    "spot": ("intensity_w_per_sr", "W/sr"),
    "directional": ("irradiance_w_per_m2", "W/m²"),
}


@dataclass(frozen=True, eq=False)
class Light:
    """A light element, its pose (4, 4) in its parent, and its name in messages."""

    element: Element
    pose: Floats
    what: str

    @property
    def kind(self) -> str:
        """Its type."""
        return self.element.get("type", "point")


def take_lights(
    lights: Sequence[Light], scene: Element | None, content: Content, what: str
) -> None:
    """Read daylight and lamps of a world, from its lights and its `<scene>`."""
    suns = [light for light in lights if light.kind == "directional"]
    content.daylight = _daylight(suns[0] if suns else None, scene, content, what)
    for light in lights:
        if light is not (suns[0] if suns else None):
            content.glows += lamp(light, content)


def take_fog(scene: Element | None, content: Content, what: str) -> None:
    """Make fog of a scene's, as Gazebo draws it (gazebo::rendering::Scene::SetFog).

    Its visibility is the distance at which 5 % of the light is left (meteorological optical range).
    """
    fog = None if scene is None else scene.find("fog")
    if fog is None:
        return
    mark_all(fog)
    with content.leaving_out(f"{what}: fog"):
        kind = (fog.findtext("type") or "none").strip().lower()
        start, end, density = (
            number_or(fog.findtext(tag), given, f"{what}: fog: {tag}")
            for tag, given in (("start", 1.0), ("end", 100.0), ("density", 1.0))
        )
        visibility_m = {
            "linear": end - LEFT_AT_MOR * (end - start),
            "exp": -np.log(LEFT_AT_MOR) / max(density, TINY),
            "exp2": np.sqrt(-np.log(LEFT_AT_MOR)) / max(density, TINY),
        }.get(kind)
        if kind == "none":
            return
        if visibility_m is None or not TINY < visibility_m < 1 / TINY:
            content.warn(
                f"{what}: fog of type {kind!r:.80} is left out: give `fog` in the scene file"
            )
            return
        content.fog = {"visibility_m": float(f"{visibility_m:.4g}"), "definition": "mor"}
        content.note(
            f"{what}: fog of type {kind} is the fog of the scene file: {visibility_m:.4g} m of "
            "visibility, where 5 % of the light is left"
        )


def lamp(light: Light, content: Content) -> list[Glow]:
    """Convert a light to a lamp, with a note; none if unsupported or dark."""
    element, what = light.element, light.what
    if light.kind not in LAMPS:
        content.note(f"{what}: lights of type {light.kind!r:.80} are left out")
        return []
    field, unit = LAMPS[light.kind]
    strength, why = _strength(element, what), ""
    if light.kind != "directional":
        factor, why = _attenuation(element, what)
        strength *= factor
    cone: dict[str, Any] = {}
    if light.kind == "spot":
        spot = element.find("spot")
        outer, inner = (
            numbers((spot.findtext(tag) if spot is not None else None) or "0", 1, what)[0]
            for tag in ("outer_angle", "inner_angle")
        )
        falloff = number_or(spot.findtext("falloff") if spot is not None else None, 0.0, what)
        why += f"; its edge has the power {falloff:.4g} there, 1 here" if falloff != 1 else ""
        cutoff = min(90.0, float(np.degrees(outer)) / 2)  # given from side to side
        cone = {"cutoff_deg": cutoff,
                "beam_deg": min(max(0.0, float(np.degrees(inner)) / 2), cutoff)}  # fmt: skip
    if not strength > 0 or not cone.get("cutoff_deg", 1) > 0:
        content.note(f"{what} is left out: it gives no light")
        return []
    content.note(f"{what} has no unit; as watts {strength:.4g} {unit}{why}")
    name = element.get("name") or light.kind
    fields = {"type": light.kind, field: strength, **cone}
    position = None if light.kind == "directional" else light.pose[:3, 3]
    direction = None if light.kind == "point" else _direction(light)
    return [Glow(name, fields, position, direction)]


def moved(glow: Glow, pose: Floats) -> Glow:
    """Return a lamp of something that stands at a pose (4, 4)."""
    position, direction = glow.position, glow.direction
    if position is not None:
        position = pose[:3, :3] @ position + pose[:3, 3]
    if direction is not None:
        direction = pose[:3, :3] @ direction
    return replace(glow, position=position, direction=direction)


def _daylight(
    sun: Light | None, scene: Element | None, content: Content, what: str
) -> Daylight | None:
    sky_klx = _sky_klx(scene, what)
    if sun is None:
        return None if sky_klx == 0 else Daylight(0.0, np.array([0.0, 0.0, -1.0]), sky_klx)
    sun_klx = SUN_KLX * _strength(sun.element, sun.what)
    content.note(
        f"{sun.what} is taken for a sun of {sun_klx:.3g} klx, with {sky_klx:.3g} klx of sky: see "
        "`ambient` in the scene file"
    )
    return Daylight(sun_klx, _direction(sun), sky_klx)


def _attenuation(element: Element, what: str) -> tuple[float, str]:
    """Return the result of `at_a_metre` with SDFormat's defaults, and the range of a light."""
    row = element.find("attenuation")
    if row is None:
        return 1.0, ""
    factors = (number_or(row.findtext(tag), given, what) for tag, given in ATTENUATION)
    factor, why = at_a_metre(*factors)
    reach = number_or(row.findtext("range"), MAX_RANGE_M, what)
    return factor, why + (f"; it ends at {reach:.4g} m there" if reach < FAR_M else "")


def _strength(element: Element, what: str) -> float:
    """Return intensity times the mean of its colour; 0 if it is off."""
    if (element.findtext("light_on") or "true").strip().lower() in ("false", "0"):
        return 0.0
    text = element.findtext("intensity") or "1"
    intensity = max(0.0, numbers(text, 1, f"{what}: intensity")[0])
    return intensity * _brightness(element.findtext("diffuse"), 1.0, what)


def _direction(light: Light) -> Floats:
    """Return the direction of a light, rotated by its pose."""
    text = light.element.findtext("direction") or "0 0 -1"
    direction = light.pose[:3, :3] @ np.array(numbers(text, 3, f"{light.what}: direction"))
    length = float(np.linalg.norm(direction))
    if not length > 0:
        raise InputError(f"{light.what}: its direction is zero")
    return np.asarray(direction / length)


def _sky_klx(scene: Element | None, what: str) -> float:
    if scene is None:
        return 0.0
    minimum = 1.0 if scene.find("sky") is not None else 0.0
    return SKY_KLX * max(minimum, _brightness(scene.findtext("ambient"), 0.0, f"{what}: ambient"))


def _brightness(color: str | None, default: float, what: str) -> float:
    """Return the mean of red, green and blue, from 0 to 1."""
    if color is None or not color.strip():
        return default
    count = max(3, min(4, len(color.split())))
    return float(np.clip(np.mean(numbers(color, count, f"{what}: colour")[:3]), 0, 1))
