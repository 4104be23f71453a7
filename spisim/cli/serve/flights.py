"""Flights of the drone: along a path, or as commanded from a pose."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, isfinite, radians, sin
from typing import TYPE_CHECKING

from reconstruction.base.errors import InputError

if TYPE_CHECKING:
    from spisim.scene import Scene, Trajectory
    from spisim.serving import Gust, Keys, Motion, Pilot

#: Maximum key poses of a path flown in real time, all of which are cached.
MAX_AHEAD = 2000
#: Maximum offset by a gust.
MAX_GUST_M = 100


@dataclass(frozen=True)
class Flight:
    """A scene with its drone, its control, and key poses, `ahead` of which are solved first."""

    scene: Scene
    keys: Keys
    pilot: Pilot
    ahead: int = 1


def check_options(
    path: str | None,
    pose: str | None,
    gust: list[str] | None,
    of_path: Mapping[str, bool],
    to: str,
    *,
    json: bool,
) -> None:
    """Check options that exclude each other, or are ``of_path`` but given without a path."""
    for option, given in of_path.items():
        if given and path is None:
            raise InputError(f"{option} needs --path")
    if json and to == "-":
        raise InputError("--json and --to - exclude each other: both write to stdout")
    for option, value in (("--pose", pose), ("--gust", gust)):
        if path is not None and value:
            raise InputError(f"--path and {option} exclude each other")


def along(scene: Scene, path: Trajectory, spacing_m: float, *, at_once: bool) -> Flight:
    """Fly along a path; its light is solved ahead, unless frames may take their time."""
    from spisim.scene import check_clear_path
    from spisim.serving import Follower, PathKeys

    check_clear_path(scene, path)
    keys = PathKeys(scene, path, spacing_m)
    return Flight(scene, keys, Follower(path), 1 if at_once else _checked(keys.count))


def as_commanded(scene: Scene, pose: str | None, gusts: list[str], spacing_m: float) -> Flight:
    """Fly as commanded from a pose, by default the scene's own."""
    from spisim.serving import Drone, PoseKeys

    begun = scene if pose is None else _placed(scene, pose)
    return Flight(begun, PoseKeys(begun, spacing_m), Drone(begun, tuple(map(_gust, gusts))))


def at_rest(scene: Scene, duration_s: float) -> Motion:
    """Return the drone of a scene at rest."""
    from scipy.spatial.transform import Rotation

    from spisim.serving import Motion

    position_m, turn = scene.drone_pose[:3, 3], Rotation.from_matrix(scene.drone_pose[:3, :3])
    return Motion(0.0, duration_s, position_m, position_m, turn, turn)


def _checked(ahead: int) -> int:
    """Check the number of key poses of a path, all of which are cached."""
    if ahead > MAX_AHEAD:
        raise InputError(
            f"the path has {ahead} key poses, at most {MAX_AHEAD} where it is flown in real time: "
            "use a larger --spacing, a shorter path, or --lockstep"
        )
    return ahead


def _placed(scene: Scene, text: str) -> Scene:
    """Return a scene with the drone at the pose of an option."""
    from spisim.scene import at_drone_state
    from spisim.scene.description import DroneState

    numbers = _numbers(text, "--pose", (3, 4, 5), "X,Y,Z[,YAW[,PITCH]] in m and degrees")
    position = x, y, z = numbers[0], numbers[1], numbers[2]
    ahead = tuple(scene.drone_pose[:3, 2].tolist())
    up = tuple((-scene.drone_pose[:3, 1]).tolist())
    if len(numbers) > 3:
        yaw, pitch = (radians(angle) for angle in (*numbers[3:], 0.0)[:2])
        ahead = cos(yaw) * cos(pitch), sin(yaw) * cos(pitch), sin(pitch)
        up = -cos(yaw) * sin(pitch), -sin(yaw) * sin(pitch), cos(pitch)
    moment = DroneState(
        time_s=0.0, position_m=position, look_at_m=(x + ahead[0], y + ahead[1], z + ahead[2]), up=up
    )
    return at_drone_state(scene, moment)


def _gust(text: str) -> Gust:
    from spisim.serving import Gust

    start_s, duration_s, x, y, z = _numbers(text, "--gust", (5,), "START,SECONDS,X,Y,Z in s and m")
    if start_s < 0 or not duration_s > 0:
        raise InputError(
            f"--gust {text}: its start should be at least 0 s, and its duration above 0 s"
        )
    if max(map(abs, (x, y, z))) > MAX_GUST_M:
        raise InputError(f"--gust {text}: its offset should be at most {MAX_GUST_M} m")
    return Gust(start_s, duration_s, (x, y, z))


def _numbers(text: str, option: str, counts: tuple[int, ...], what: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(isfinite, numbers)):
        raise InputError(f"{option} {text}: should be {what}")
    return numbers
