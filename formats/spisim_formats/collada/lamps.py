"""Lamps of COLLADA files, which have no unit: their numbers are used as they are.

https://www.khronos.org/files/collada_spec_1_4.pdf
"""

from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_formats.library.content import Content, Glow
from spisim_formats.library.files import quoted
from spisim_formats.library.units import at_a_metre

#: COLLADA's default attenuation.
CONE_DEG, UNATTENUATED = 180.0, (1.0, 0.0, 0.0)


def light(lamp: Any, to_world: Floats, name: str, content: Content) -> list[Glow]:
    """Convert a light of pycollada, with a note; none if it gives no light."""
    from collada.light import DirectionalLight, PointLight, SpotLight

    strength = float(np.mean(np.asarray(lamp.color, float)[:3]))
    direction = -to_world[:3, 2]
    length = float(np.linalg.norm(direction))
    what = f"lamp {quoted(name)}"
    if not isinstance(lamp, DirectionalLight | PointLight | SpotLight):
        content.note(f"{what}: ambient light is left out; see `ambient` in the scene file")
        return []
    if not (0 < strength < np.inf and 0 < length < np.inf):
        content.note(f"{what} is left out: it gives no light")
        return []
    direction = direction / length
    if isinstance(lamp, DirectionalLight):
        content.note(f"{what} has no unit; as watts {strength:.4g} W/m²")
        fields = {"type": "directional", "irradiance_w_per_m2": strength}
        return [Glow(name, fields, None, direction)]
    attenuation = (lamp.constant_att, lamp.linear_att, lamp.quad_att)
    factor, why = at_a_metre(
        *(given if value is None else float(value)
          for value, given in zip(attenuation, UNATTENUATED, strict=True))
    )  # fmt: skip
    strength *= factor
    kind, cone = "point", {}
    if isinstance(lamp, SpotLight):
        kind, cone = "spot", _cone(lamp)
        why += "; its edge is softer there" if lamp.falloff_exp else ""
    content.note(f"{what} has no unit; as watts {strength:.4g} W/sr{why}")
    fields = {"type": kind, "intensity_w_per_sr": strength, **cone}
    return [Glow(name, fields, to_world[:3, 3], direction if cone else None)]


def _cone(lamp: Any) -> dict[str, float]:
    """Convert an angle from side to side, as written by Blender and Maya, to a sharp cone."""
    angle = CONE_DEG if lamp.falloff_ang is None else float(lamp.falloff_ang)
    cutoff = min(90.0, angle / 2) if angle > 0 else 90.0
    return {"cutoff_deg": cutoff, "beam_deg": cutoff}
