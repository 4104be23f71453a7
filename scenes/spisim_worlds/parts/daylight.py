"""Daylight outdoors, drawn."""

from typing import Any

import numpy as np


def outdoors(rng: np.random.Generator) -> dict[str, Any]:
    """Fields of a builder: an overcast sky, or as often the sun 15° to 60° high and a blue one."""
    overcast = rng.random() < 0.5
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(15, 60))
    sun_klx, overcast_klx, blue_klx = rng.uniform(20, 90), rng.uniform(1, 15), rng.uniform(8, 18)
    if overcast:
        return {"sky_klx": float(overcast_klx)}
    level = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
    direction = (*level.tolist(), -float(np.sin(elevation)))
    return {"sun_klx": float(sun_klx), "sun_direction": direction, "sky_klx": float(blue_klx)}
