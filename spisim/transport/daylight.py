"""Sun and sky: the steady in-band power on every detector."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np

from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.reference import Renderer
from spisim.transport.views import DetectorView, Floats

_SKY_ROWS = 64


def daylight_emitters(scene: Scene, instrument: Instrument) -> dict[str, Any]:
    """Sun and uniform upper hemisphere as Mitsuba emitters, in-band W/m² and W m⁻² sr⁻¹."""
    ambient = scene.ambient
    emitters: dict[str, Any] = {}
    if ambient.sun_klx > 0:
        irradiance = instrument.daylight_irradiance(ambient.sun_klx)
        emitters["sun"] = {
            "type": "directional",
            "direction": list(ambient.sun_direction),
            "irradiance": {"type": "rgb", "value": [irradiance] * 3},
        }
    if ambient.sky_klx > 0:
        # E = π L for a uniform hemisphere; the map's rows run from the zenith down.
        sky = np.zeros((_SKY_ROWS, 2 * _SKY_ROWS, 1), dtype=np.float32)
        sky[: _SKY_ROWS // 2] = instrument.daylight_irradiance(ambient.sky_klx) / np.pi
        emitters["sky"] = {
            "type": "envmap",
            "bitmap": mi.Bitmap(sky),
            "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),  # Mitsuba's maps are y-up
        }
    return emitters


@with_backend
def daylight_power(
    scene: Scene, instrument: Instrument, detectors: DetectorView, *, samples: int, seed: int
) -> Floats:
    """In-band power of sun and sky on each detector's aperture, W, (detectors,)."""
    emitters = daylight_emitters(scene, instrument)
    if not emitters:
        return np.zeros(len(detectors.positions_m))
    return Renderer(scene, emitters).power(detectors, samples=samples, seed=seed)
