"""What a camera at the projector would see."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.daylight import daylight_emitters
from spisim.transport.reference import Renderer, pattern_emitter
from spisim.transport.views import InstrumentView

#: The camera sits this far above the pinhole: light and camera in one point would see no shading.
CAMERA_OFFSET_M = 0.05


@with_backend
def camera_view(
    scene: Scene,
    instrument: Instrument,
    *,
    width: int = 256,
    height: int = 256,
    fov_deg: float | None = None,
    spp: int = 48,
    seed: int = 0,
) -> NDArray[np.float32]:
    """In-band radiance (height, width), W m⁻² sr⁻¹, all pixels on, sun and sky included.

    `fov_deg` is the full angle across the width, by default the projector's.
    """
    placed = InstrumentView.of(instrument, scene.drone_pose)
    power = instrument.projector.power_w * instrument.projector.in_band_fraction
    emitters: dict[str, Any] = daylight_emitters(scene, instrument)
    emitters["projector"] = pattern_emitter(placed.projector, power / placed.projector.pixels)
    renderer = Renderer(scene, emitters)

    half_width = placed.projector.tan_half_width
    if fov_deg is not None:
        half_width = float(np.tan(np.radians(fov_deg) / 2))
    pixels = width * height
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, seed), pixels * spp)
    cell = dr.arange(mi.UInt32, pixels * spp) % pixels
    jitter = sampler.next_2d()
    x = (2 * (mi.Float(cell % width) + jitter.x) / width - 1) * half_width
    y = (2 * (mi.Float(cell // width) + jitter.y) - height) / width * half_width
    to_world = mi.Transform4f(mi.Matrix4f(scene.drone_pose.astype(np.float32)))
    origin = to_world @ mi.Point3f(0, -CAMERA_OFFSET_M, 0)
    direction = to_world @ dr.normalize(mi.Vector3f(x, y, 1))
    radiance = renderer.radiance(origin, direction, sampler).numpy()
    return np.asarray(radiance.reshape(spp, height, width).mean(axis=0), dtype=np.float32)
