"""Lamps of glTF files (KHR_lights_punctual), which are in candela and lux.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_lights_punctual
"""

from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene.lamps import solid_angle
from spisim_formats.library.content import Content, Glow
from spisim_formats.library.files import quoted

PUNCTUAL = "KHR_lights_punctual"


def node_lamps(
    node: dict[str, Any], header: dict[str, Any], to_world: Floats, content: Content
) -> list[Glow]:
    """Convert the lamp of a node, with a note; none without one, or if it gives no light."""
    number = node.get("extensions", {}).get(PUNCTUAL, {}).get("light")
    if number is None:
        return []
    rows = header.get("extensions", {}).get(PUNCTUAL, {}).get("lights", [])
    row = dict(enumerate(rows)).get(number, {})
    kind = row.get("type")
    name = row.get("name") or node.get("name") or "lamp"
    if kind not in ("point", "spot", "directional"):
        content.note(f"lamp {quoted(name)} is damaged: it is left out")
        return []
    strength = float(row.get("intensity", 1.0)) * float(np.mean(row.get("color", [1, 1, 1])))
    direction = -to_world[:3, 2]
    length = float(np.linalg.norm(direction))
    cone = row.get("spot", {})
    cutoff = min(np.pi / 2, float(cone.get("outerConeAngle", np.pi / 4)))
    beam = min(cutoff, max(0.0, float(cone.get("innerConeAngle", 0.0))))
    if not (0 < strength < np.inf and 0 < length < np.inf and cutoff > 0):
        content.note(f"lamp {quoted(name)} is left out: it gives no light")
        return []
    direction = direction / length
    if kind == "directional":
        content.note(f"lamp {quoted(name)}: {strength:.4g} lx")
        fields = {"type": kind, "illuminance_klx": strength / 1000}
        return [Glow(name, fields, None, direction)]
    content.note(f"lamp {quoted(name)}: {strength:.4g} cd")
    if kind == "point":
        fields = {"type": kind, "luminous_flux_lm": 4 * np.pi * strength}
        return [Glow(name, fields, to_world[:3, 3])]
    fields = {
        "type": kind,
        "luminous_flux_lm": strength * solid_angle(cutoff, beam),
        "cutoff_deg": float(np.degrees(cutoff)),
        "beam_deg": float(np.degrees(beam)),
    }
    return [Glow(name, fields, to_world[:3, 3], direction)]
