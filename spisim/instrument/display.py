"""What notebooks and consoles show of an instrument: its facts, and a picture of its field."""

from typing import Any

import numpy as np

from reconstruction.base.display import drawing, figure
from reconstruction.operators import PatternPlan
from spisim.instrument.fitting import Imaging, Ranging


def facts(
    wavelength_nm: float,
    frame_time_s: float,
    plan: PatternPlan,
    imaging: Imaging | None,
    ranging: Ranging | None,
) -> dict[str, Any]:
    """Facts by name; `plan` is that of the first frame."""
    result: dict[str, Any] = {"wavelength": f"{wavelength_nm:g} nm"}
    if imaging is not None:
        projector, _, detector, _ = imaging
        shape = f"{plan.shape[0]} × {plan.shape[1]}"
        result |= {
            "patterns": f"{plan.sampled} of {shape} pixels, {plan.basis}",
            "projector": f"{projector.power_w:g} W over {projector.fov_deg:g}°",
            "detector": f"{detector.sensor.type}, {detector.field_of_view_deg:g}°",
        }
    result["frame"] = f"{1e3 * frame_time_s:.4g} ms"
    if ranging is not None:
        (lasers, tof), zones = ranging, ranging.zones
        if zones is None:
            result["lasers"] = f"{ranging.spots} × {1e3 * lasers.power_w:g} mW"
        else:
            result["zones"] = "{} × {} under {:g} W".format(*zones.shape, zones.power_w)
        result["ranging"] = tof.method
    return result


def field_picture(imaging: Imaging | None, ranging: Ranging | None) -> str:
    """HTML of the projector's field and the spots, as seen along the optical axis."""
    size, spots = np.zeros(2), np.zeros((0, 2))
    if imaging is not None:
        size = np.array([imaging.projector.tan_half_width, imaging.projector.tan_half_height])
    if ranging is not None:
        directions = ranging.lasers.directions
        spots = directions[:, :2] / directions[:, 2:] * (1, -1)
    wide = 1.1 * float(np.abs(np.vstack([size, spots, [1e-3, 0]])).max())
    line = f'stroke-width="{wide / 100:.4g}"'
    (x, y), (width, height) = -size, 2 * size
    drawn = [f'<rect x="{x:.5g}" y="{y:.5g}" width="{width:.5g}" height="{height:.5g}" {line}/>']
    drawn += [
        f'<circle cx="{x:.5g}" cy="{y:.5g}" r="{wide / 30:.4g}" stroke="crimson" {line}/>'
        for x, y in spots
    ]
    return figure(drawing(drawn, (-wide, -wide), (wide, wide)), "field, and spots in red")
