"""Collisions of moving objects with the instrument."""

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene.model import Scene, SceneObject
from spisim.scene.rays import first_hits

#: Maximum turn of a straight step along a curved path.
MAX_TURN_RAD = np.radians(1.0)
#: More steps take minutes and exhaust the memory.
MAX_STEPS = 1_000_000


def check_steps(count: float, what: str) -> None:
    """InputError, starting with `what`, for a motion of too many steps."""
    if not count <= MAX_STEPS:
        raise InputError(
            f"{what} moves too far or turns too often: it takes {count:.3g} steps, at most "
            f"{MAX_STEPS:.0g}"
        )


def check_clear_of_sensor(scene: Scene, duration_s: float) -> None:
    """Check that no surface sweeps over the drone's position.

    Parameters
    ----------
    scene : Scene
        The scene at the start; what moves with the drone stays clear of it.
    duration_s : float
        Time to check.

    Raises
    ------
    InputError
        Names object and time of the collision.
    """
    if not scene.moves:
        return
    for thing in scene.objects:
        turn = float(np.linalg.norm(thing.angular_velocity_rad_s)) * duration_s
        steps = max(1.0, np.ceil(turn / MAX_TURN_RAD))
        check_steps(steps, f"scene {scene.name!r}: object {thing.name!r}")
        times = np.linspace(0, duration_s, 1 + int(steps))
        path = scene.drone_pose[:3, 3] + np.outer(times, scene.drone_velocity_m_s)
        time_s = meeting_time(thing, times, path)
        if time_s < np.inf:
            raise InputError(
                f"scene {scene.name!r}: object {thing.name!r} passes through the instrument "
                f"{time_s:.4g} s after the start; change velocity_m_s of one of them, or record "
                "for a shorter time"
            )


def meeting_time(thing: SceneObject, times_s: Floats, path_m: Floats) -> float:
    """Time at which a point on `path_m` (n, 3) at `times_s` first crosses an object, or inf."""
    path = path_m
    if thing.moves:
        path = np.array(
            [_seen_from(thing, time, at) for time, at in zip(times_s, path_m, strict=True)]
        )
    centre, radius_m = thing.mesh.bounds.mean(axis=0), np.linalg.norm(thing.mesh.extents) / 2
    strides_m = np.linalg.norm(np.diff(path, axis=0), axis=1)
    near = np.linalg.norm(path[:-1] - centre, axis=1) <= radius_m + strides_m
    steps = np.flatnonzero(near & (strides_m > 0))
    if steps.size == 0:
        return np.inf
    triangles = _around(thing.mesh.triangles, path)
    for step in steps:
        start, stop = path[step : step + 2]
        fraction = first_hits(start, (stop - start)[None], triangles)[0]
        if fraction <= 1:
            return float(times_s[step] + fraction * (times_s[step + 1] - times_s[step]))
    return np.inf


def _around(triangles: Floats, path: Floats) -> Floats:
    """Triangles (t, 3, 3) that intersect the bounding box of a path (n, 3)."""
    low, high = path.min(axis=0), path.max(axis=0)
    apart = (triangles.max(axis=1) < low) | (triangles.min(axis=1) > high)
    return triangles[~apart.any(axis=1)]


def _seen_from(thing: SceneObject, time_s: float, position_m: Floats) -> Floats:
    """A world position (3,) after `time_s` in a frame that moves with the object."""
    back = np.linalg.inv(thing.motion(time_s))
    return np.asarray(back[:3, :3] @ position_m + back[:3, 3])
