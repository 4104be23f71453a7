"""Pilots: one flies to commanded poses and stops in front of obstacles, one follows a path."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene import Scene, Trajectory, enclosing_object
from spisim.scene.trajectory import FRAMES
from spisim.simulation.flight.motion import Motion
from spisim_live import Pose
from spisim_serving.obstacles import Obstacles

#: Limits at which a drone follows commands.
TOP_SPEED_M_S = 5.0
TOP_SPIN_RAD_S = math.pi
#: A motion is checked for obstacles in steps of this length.
STEP_M = 0.02


class Gust(NamedTuple):
    """Displaces the drone by (forward, left, up) in axes of its start, unknown to its odometry."""

    start_s: float
    duration_s: float
    offset_m: tuple[float, float, float]

    def moved_m(self, time_s: float) -> Floats:
        """Displacement (3,) at a time, which grows smoothly from zero."""
        done = min(max((time_s - self.start_s) / self.duration_s, 0.0), 1.0)
        return np.asarray(self.offset_m) * (1 - math.cos(math.pi * done)) / 2


class Pilot(Protocol):
    """Decides where a drone goes, frame by frame; `trouble` is what blocks it, if anything."""

    trouble: str | None

    def fly(self, commanded: Pose | None, time_s: float, duration_s: float) -> Motion | None:
        """Next motion, towards the last commanded pose; None when the flight is over."""


class Drone:
    """Flies straight to commanded poses by dead reckoning, at most `TOP_SPEED_M_S` fast.

    Parameters
    ----------
    scene
        Holds the obstacles, and the drone in its first pose.
    gusts
        Displacements that the drone does not notice.

    Raises
    ------
    InputError
        If the first pose lies inside or too close to an object.
    """

    def __init__(self, scene: Scene, gusts: tuple[Gust, ...] = ()) -> None:
        self.trouble: str | None = None
        self._obstacles = Obstacles(scene)
        self._origin_m = scene.drone_pose[:3, 3]
        optical = Rotation.from_matrix(scene.drone_pose[:3, :3])
        self._body = optical * FRAMES["body"].inv()
        self._gusts = gusts
        self._commanded = Pose()
        self._reckoned_m = np.zeros(3)
        self._attitude = Rotation.identity()
        self._drift_m = np.zeros(3)
        self._gap_m = np.inf
        if inside := enclosing_object(scene, self._origin_m):
            raise InputError(f"{_at(self._origin_m)}: the drone starts inside object {inside!r}")
        if problem := self._obstacles.problem(self._origin_m, 0.0):
            raise InputError(f"{_at(self._origin_m)}: the drone cannot start here: {problem}")

    def fly(self, commanded: Pose | None, time_s: float, duration_s: float) -> Motion:
        """See `Pilot`."""
        self._commanded = commanded or self._commanded
        way_m = np.asarray(self._commanded.position_m) - self._reckoned_m
        way_m = way_m * _within(float(np.linalg.norm(way_m)), TOP_SPEED_M_S * duration_s)
        turn = (self._attitude.inv() * Rotation.from_quat(self._commanded.quaternion)).as_rotvec()
        turn = turn * _within(float(np.linalg.norm(turn)), TOP_SPIN_RAD_S * duration_s)
        stop_s = time_s + duration_s
        gusts_m = [gust.moved_m(stop_s) - gust.moved_m(time_s) for gust in self._gusts]
        blown_m = np.sum(gusts_m, axis=0) if gusts_m else np.zeros(3)
        start_m, start = self._position_m, self._optical
        fraction = self._clear(self._body.apply(way_m + blown_m), time_s, duration_s)
        self._reckoned_m = self._reckoned_m + fraction * way_m
        self._drift_m = self._drift_m + fraction * blown_m
        self._attitude = self._attitude * Rotation.from_rotvec(turn)
        return Motion(time_s, duration_s, start_m, self._position_m, start, self._optical)

    @property
    def _position_m(self) -> Floats:
        return np.asarray(self._origin_m + self._body.apply(self._reckoned_m + self._drift_m))

    @property
    def _optical(self) -> Rotation:
        return self._body * self._attitude * FRAMES["body"]

    def _clear(self, way_m: Floats, time_s: float, duration_s: float) -> float:
        """Fraction of a displacement (3,) that is free; sets `trouble` unless it is 1."""
        steps = max(1, math.ceil(float(np.linalg.norm(way_m)) / STEP_M))
        start_m = self._position_m
        self.trouble = None
        for step in range(1, steps + 1):
            there_m, then_s = start_m + way_m * step / steps, time_s + duration_s * step / steps
            if problem := self._obstacles.problem(there_m, then_s, self._gap_m):
                here_m = start_m + way_m * (step - 1) / steps
                self._gap_m, _ = self._obstacles.nearest(here_m, then_s)
                self.trouble = f"{_at(here_m)}: the drone stays here: {problem}"
                return (step - 1) / steps
            self._gap_m, _ = self._obstacles.nearest(there_m, then_s)
        return 1.0


class Follower:
    """Flies a path and ignores commands."""

    def __init__(self, path: Trajectory) -> None:
        self.trouble: str | None = None
        self._path = path

    def fly(self, commanded: Pose | None, time_s: float, duration_s: float) -> Motion | None:
        """See `Pilot`."""
        return Motion.along(self._path, time_s, duration_s)


def _within(length: float, maximum: float) -> float:
    """Fraction of a length that is within the maximum."""
    return min(1.0, maximum / length) if length > 0 else 1.0


def _at(position_m: Floats) -> str:
    return f"position ({', '.join(f'{value:.2f}' for value in position_m)}) m"
