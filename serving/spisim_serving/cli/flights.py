"""Flights: along a path, or as commands say from a pose on."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, isfinite, radians, sin
from typing import TYPE_CHECKING, Annotated

import typer

from reconstruction.base.errors import InputError
from spisim_app.cli import options as opt

if TYPE_CHECKING:
    from spisim.scene import Scene, Trajectory
    from spisim.simulation.flight import Keys
    from spisim_serving.drone import Gust, Pilot

#: Key poses of a path that is flown in real time, all of which are cached.
MAX_AHEAD = 2000
#: Maximum displacement by a gust.
MAX_GUST_M = 100


@dataclass(frozen=True)
class Flight:
    """A scene with its drone, its pilot, and key poses, `ahead` of which are solved at first."""

    scene: Scene
    keys: Keys
    pilot: Pilot
    ahead: int = 1


@dataclass(frozen=True)
class FlightOptions:
    """Where the drone flies: along a path, or as commands say from a pose on."""

    path: Annotated[
        str | None,
        typer.Option("--path", metavar="FILE", help="Fly it; else as commands say. CSV or TUM."),
    ] = None
    pose: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z[,YAW[,PITCH]]", help="Begin here, in m and degrees."),
    ] = None
    gust: Annotated[
        list[str] | None,
        typer.Option(
            metavar="START,SECONDS,X,Y,Z",
            help="Blows the drone off by so many m forward, left and up; it does not notice.",
        ),
    ] = None
    frame: Annotated[
        str, typer.Option(help="What quaternions of the path turn: body or optical.")
    ] = "body"
    speed: Annotated[
        float, opt.real_option("Fly the path X times as fast.", minimum=0.01, maximum=100)
    ] = 1.0

    def __post_init__(self) -> None:
        """InputError for options that exclude each other, or that need a path."""
        for option, given in (("--frame", self.frame != "body"), ("--speed", self.speed != 1)):
            if given and self.path is None:
                raise InputError(f"{option} goes with --path")
        for option, value in (("--pose", self.pose), ("--gust", self.gust)):
            if self.path is not None and value:
                raise InputError(f"--path and {option} exclude each other")

    def trajectory(self) -> Trajectory | None:
        """Load the path, if there is one; InputError if it cannot be used."""
        from spisim.scene import load_trajectory

        return (
            None if self.path is None else load_trajectory(self.path, self.frame).faster(self.speed)
        )

    def flight(
        self, scene: Scene, path: Trajectory | None, spacing_m: float, *, at_once: bool
    ) -> Flight:
        """The flight; along a path the light is solved ahead unless frames may take their time."""
        from spisim.scene import check_clear_path
        from spisim.simulation.flight import PathKeys, PoseKeys
        from spisim_serving.drone import Drone, Follower

        if path is None:
            begun = scene if self.pose is None else _placed(scene, self.pose)
            gusts = tuple(map(_gust, self.gust or []))
            return Flight(begun, PoseKeys(begun, spacing_m), Drone(begun, gusts))
        check_clear_path(scene, path)
        keys = PathKeys(scene, path, spacing_m)
        return Flight(scene, keys, Follower(path), 1 if at_once else _checked(keys.count))


AS_COMMANDED = FlightOptions()


def _checked(ahead: int) -> int:
    """Number of key poses of a path, all of which are cached; InputError for too many."""
    if ahead > MAX_AHEAD:
        raise InputError(
            f"the path has {ahead} key poses; at most {MAX_AHEAD} are allowed in real time: "
            "use a larger --spacing, a shorter path, or --lockstep"
        )
    return ahead


def _placed(scene: Scene, text: str) -> Scene:
    """A scene with the drone in the pose of the option."""
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
    state = DroneState(
        time_s=0.0, position_m=position, look_at_m=(x + ahead[0], y + ahead[1], z + ahead[2]), up=up
    )
    return at_drone_state(scene, state)


def _gust(text: str) -> Gust:
    from spisim_serving.drone import Gust

    start_s, duration_s, x, y, z = _numbers(text, "--gust", (5,), "START,SECONDS,X,Y,Z in s and m")
    if start_s < 0 or not duration_s > 0:
        raise InputError(f"--gust {text}: must begin at 0 s or later, and last longer than 0 s")
    if max(map(abs, (x, y, z))) > MAX_GUST_M:
        raise InputError(f"--gust {text}: must blow the drone off by at most {MAX_GUST_M} m")
    return Gust(start_s, duration_s, (x, y, z))


def _numbers(text: str, option: str, counts: tuple[int, ...], what: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(isfinite, numbers)):
        raise InputError(f"{option} {text}: must be {what}")
    return numbers
