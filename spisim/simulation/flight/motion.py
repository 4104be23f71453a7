"""Motion of a drone during one frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from spisim.scene import Scene, Trajectory
from spisim.scene.model import SceneObject, Volume
from spisim.scene.pose import Vector3


@dataclass(frozen=True, eq=False)
class Motion:
    """Uniform straight motion and rotation during a frame.

    Attributes
    ----------
    time_s, duration_s
        Start in simulation time, and duration.
    start_m, stop_m
        Positions (3,) in the world.
    start, stop
        World from optical frame, which is x right, y down, z forward.
    """

    time_s: float
    duration_s: float
    start_m: Floats
    stop_m: Floats
    start: Rotation
    stop: Rotation

    @classmethod
    def along(cls, path: Trajectory, time_s: float, duration_s: float) -> Motion | None:
        """Motion along a path from a time on; None if the path ends before it does."""
        stop_s = time_s + duration_s
        if stop_s > path.duration_s * (1 + 1e-9):
            return None
        poses = [path.pose(min(each, path.duration_s)) for each in (time_s, stop_s)]
        (start_m, stop_m), (start, stop) = (
            [pose[:3, 3] for pose in poses],
            [Rotation.from_matrix(pose[:3, :3]) for pose in poses],
        )
        return cls(time_s, duration_s, start_m, stop_m, start, stop)

    @classmethod
    def at_rest(cls, scene: Scene, duration_s: float) -> Motion:
        """No motion, in the pose that the scene gives the drone."""
        position_m, turn = scene.drone_pose[:3, 3], Rotation.from_matrix(scene.drone_pose[:3, :3])
        return cls(0.0, duration_s, position_m, position_m, turn, turn)

    def positions_m(self, fractions: Floats) -> Floats:
        """Positions (M, 3) after fractions (M,) of the motion."""
        return np.asarray(self.start_m + np.outer(fractions, self.stop_m - self.start_m))

    def turns(self, fractions: Floats) -> Rotation:
        """World from optical frame (M,) after fractions (M,) of the motion."""
        return self.start * Rotation.from_rotvec(np.outer(fractions, self._turn_rad))

    def scene(self, scene: Scene, fraction: float = 0.0) -> Scene:
        """The scene after a fraction of the motion, with the drone's pose and velocity."""
        pose = np.eye(4)
        pose[:3, :3] = self.turns(np.array([fraction])).as_matrix()[0]
        pose[:3, 3] = self.positions_m(np.array([fraction]))[0]
        velocity = (self.stop_m - self.start_m) / self.duration_s
        spin = self.start.apply(self._turn_rad) / self.duration_s
        placed = scene_at(scene, self.time_s + fraction * self.duration_s, pose)
        return replace(
            placed, drone_velocity_m_s=_vector(velocity), drone_angular_velocity_rad_s=_vector(spin)
        )

    @cached_property
    def _turn_rad(self) -> Floats:
        """Rotation vector from start to stop, in the axes of the start."""
        return np.asarray((self.start.inv() * self.stop).as_rotvec())


def scene_at(scene: Scene, time_s: float, pose: Floats) -> Scene:
    """A scene after a time, with the drone at rest in a pose (4, 4)."""
    still = (0.0, 0.0, 0.0)
    following = scene.at(time_s) if things_move(scene) else scene
    return replace(
        following, drone_pose=pose, drone_velocity_m_s=still, drone_angular_velocity_rad_s=still
    )


def things_move(scene: Scene) -> bool:
    """Whether anything but the drone moves."""
    parts: tuple[SceneObject | Volume, ...] = (*scene.objects, *scene.volumes)
    return any(part.moves for part in parts)


def _vector(values: Floats) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z
