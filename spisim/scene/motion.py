"""Whether anything flies into the instrument."""

from __future__ import annotations

import numpy as np

from reconstruction.errors import InputError
from spisim.scene.model import Floats, Scene, SceneObject
from spisim.scene.rays import first_hits

#: A curved path is followed in straight steps of at most this turn.
MAX_TURN_RAD = np.radians(1.0)


def check_clear_of_sensor(scene: Scene, duration_s: float) -> None:
    """Raise InputError, naming object and time, if a surface sweeps over the drone's position.

    `duration_s` counts from the scene as it is. What moves with the drone stays clear of it.
    """
    if not scene.moves:
        return
    for thing in scene.objects:
        time_s = _meeting_time(scene, thing, duration_s)
        if time_s < np.inf:
            raise InputError(
                f"scene {scene.name!r}: object {thing.name!r} passes through the instrument "
                f"{time_s:.4g} s after the start; change velocity_m_s of one of them, or record "
                "for a shorter time"
            )


def _meeting_time(scene: Scene, thing: SceneObject, duration_s: float) -> float:
    """When the drone's path, as seen from the object, first crosses its surface; inf if never."""
    turn = float(np.linalg.norm(thing.angular_velocity_rad_s)) * duration_s
    times = np.linspace(0, duration_s, 1 + max(1, int(np.ceil(turn / MAX_TURN_RAD))))
    path = np.array([_drone_seen_from(scene, thing, time) for time in times])
    centre, reach_m = thing.mesh.bounds.mean(axis=0), np.linalg.norm(thing.mesh.extents) / 2
    strides_m = np.linalg.norm(np.diff(path, axis=0), axis=1)
    near = np.linalg.norm(path[:-1] - centre, axis=1) <= reach_m + strides_m
    for step in np.flatnonzero(near & (strides_m > 0)):
        start, stop = path[step : step + 2]
        fraction = first_hits(start, (stop - start)[None], thing.mesh.triangles)[0]
        if fraction <= 1:
            return float(times[step] + fraction * (times[step + 1] - times[step]))
    return np.inf


def _drone_seen_from(scene: Scene, thing: SceneObject, time_s: float) -> Floats:
    """The drone's position after `time_s` in a frame that moves with the object, (3,)."""
    position = scene.drone_pose[:3, 3] + np.multiply(scene.drone_velocity_m_s, time_s)
    back = np.linalg.inv(thing.motion(time_s))
    return np.asarray(back[:3, :3] @ position + back[:3, 3])
