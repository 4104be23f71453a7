"""Sun and sky of a Gazebo world as daylight.

Gazebo's light has no unit. A sun of intensity and colour 1 is taken for the sun of a clear day at
noon, and `ambient` light of 1 for all of a clear sky; a `sky` alone is a clear one.
"""

from xml.etree.ElementTree import Element

import numpy as np

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.scene.importing.frames import read_pose
from spisim.scene.importing.model import Content, Daylight
from spisim.scene.importing.xml import numbers

SUN_KLX, SKY_KLX = 100.0, 20.0


def daylight(world: Element, content: Content, what: str) -> Daylight | None:
    """Daylight of a world, from its first directional light; other lights are noted."""
    suns = [light for light in world.findall("light") if light.get("type") == "directional"]
    lamps = len(list(world.iter("light"))) - len(suns)
    if lamps:
        content.note(f"{lamps} lamps are left out; daylight alone is in scene files")
    sky_klx = _sky_klx(world.find("scene"), what)
    if not suns:
        return None if sky_klx == 0 else Daylight(0.0, np.array([0.0, 0.0, -1.0]), sky_klx)
    sun = suns[0]
    name = f"{what}: light {sun.get('name', '')!r:.80}"
    strength = numbers(sun.findtext("intensity") or "1", 1, f"{name}: intensity")[0]
    sun_klx = SUN_KLX * max(0.0, strength) * _brightness(sun.findtext("diffuse"), 1.0, name)
    content.note(
        f"{name} is taken for a sun of {sun_klx:.3g} klx, with {sky_klx:.3g} klx of sky: see "
        "`ambient` in the scene file"
    )
    return Daylight(sun_klx, _direction(sun, name), sky_klx)


def _direction(sun: Element, what: str) -> Floats:
    """Of a light that is turned by its pose, in the world."""
    given = numbers(sun.findtext("direction") or "0 0 -1", 3, f"{what}: direction")
    pose, _ = read_pose(sun.find("pose"), what)
    direction = pose[:3, :3] @ np.array(given)
    length = float(np.linalg.norm(direction))
    if not length > 0:
        raise InputError(f"{what}: its direction is zero")
    return np.asarray(direction / length)


def _sky_klx(scene: Element | None, what: str) -> float:
    if scene is None:
        return 0.0
    least = 1.0 if scene.find("sky") is not None else 0.0
    return SKY_KLX * max(least, _brightness(scene.findtext("ambient"), 0.0, f"{what}: ambient"))


def _brightness(color: str | None, default: float, what: str) -> float:
    """Mean of red, green and blue, from 0 to 1."""
    if color is None or not color.strip():
        return default
    count = max(3, min(4, len(color.split())))
    return float(np.clip(np.mean(numbers(color, count, f"{what}: colour")[:3]), 0, 1))
