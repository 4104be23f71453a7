"""Key poses, at which light is solved: a lattice of poses, or of times along a path."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from spisim.scene import Scene, Trajectory
from spisim.simulation.flight.motion import Motion, scene_at, things_move
from spisim.simulation.light.lattice import Node
from spisim.simulation.light.sequence import SPACING_M, TURN_RAD

#: Maximum time between key poses where anything but the drone moves.
INTERVAL_S = 0.1
#: Sampling rate at which the length of a path is measured.
SAMPLES_PER_S = 1000.0


class Keys(Protocol):
    """A lattice of key poses: lattice coordinates of a motion, and the scene at each node."""

    def positions(self, motion: Motion, fractions: Floats) -> Floats:
        """Lattice coordinates (M, d) after fractions (M,) of a motion."""

    def scene(self, node: Node) -> Scene:
        """The scene at a node, with the drone at rest."""


class PoseKeys:
    """Poses relative to the first: position and rotation vector in its optical axes.

    A last coordinate is the time where anything but the drone moves.

    Parameters
    ----------
    scene
        Holds the drone in its first pose.
    spacing_m
        Distance between key poses.
    """

    def __init__(self, scene: Scene, spacing_m: float = SPACING_M) -> None:
        self._scene = scene
        self._steps = np.array([spacing_m] * 3 + [TURN_RAD] * 3)
        self._origin_m = scene.drone_pose[:3, 3]
        self._axes = Rotation.from_matrix(scene.drone_pose[:3, :3])
        self._interval_s = interval_s(scene, spacing_m) if things_move(scene) else None

    def positions(self, motion: Motion, fractions: Floats) -> Floats:
        """See `Keys`."""
        back = self._axes.inv()
        moved = back.apply(motion.positions_m(fractions) - self._origin_m)
        turned = (back * motion.turns(fractions)).as_rotvec()
        positions = np.concatenate([moved, turned], axis=1) / self._steps
        if self._interval_s is None:
            return positions
        times_s = motion.time_s + fractions * motion.duration_s
        return np.column_stack([positions, times_s / self._interval_s])

    def scene(self, node: Node) -> Scene:
        """See `Keys`."""
        step = np.array(node[:6]) * self._steps
        pose = np.eye(4)
        pose[:3, :3] = (self._axes * Rotation.from_rotvec(step[3:])).as_matrix()
        pose[:3, 3] = self._origin_m + self._axes.apply(step[:3])
        return scene_at(self._scene, node[6] * self._interval_s if self._interval_s else 0.0, pose)


class PathKeys:
    """Times along a path, `count` of them, spaced so that key poses are close enough.

    Parameters
    ----------
    scene, path
        What moves, and the drone's way through it.
    spacing_m
        Maximum distance between key poses.
    """

    def __init__(self, scene: Scene, path: Trajectory, spacing_m: float = SPACING_M) -> None:
        self._scene = scene
        self._path = path
        samples = int(np.ceil(path.duration_s * SAMPLES_PER_S)) + 1
        self._times_s = np.linspace(0, path.duration_s, samples)
        between = np.diff(self._times_s)
        rate = np.linalg.norm(path.positions_m(self._times_s[1:], 1), axis=1) / spacing_m
        spin = np.linalg.norm(path.orientations(self._times_s[1:], 1), axis=1) / TURN_RAD
        rate = np.maximum(rate, spin)
        if things_move(scene):
            rate = np.maximum(rate, 1 / interval_s(scene, spacing_m))
        position = np.concatenate([[0.0], np.cumsum(rate * between)])
        last = max(np.ceil(position[-1]), 1.0)
        self._positions = position * (last / position[-1]) if position[-1] > 0 else position
        self.count = int(last) + 1

    def positions(self, motion: Motion, fractions: Floats) -> Floats:
        """See `Keys`."""
        times_s = motion.time_s + fractions * motion.duration_s
        return np.interp(times_s, self._times_s, self._positions)[:, None]

    def scene(self, node: Node) -> Scene:
        """See `Keys`."""
        time_s = float(np.interp(node[0], self._positions, self._times_s))
        return scene_at(self._scene, time_s, self._path.pose(time_s))


def interval_s(scene: Scene, spacing_m: float) -> float:
    """Time in which nothing in a scene moves or turns farther than one key step."""
    rates = [1 / INTERVAL_S]
    rates += [float(np.linalg.norm(each.velocity_m_s)) / spacing_m for each in scene.objects]
    spins = (np.linalg.norm(each.angular_velocity_rad_s) for each in scene.objects)
    rates += [float(spin / TURN_RAD) for spin in spins]
    return 1 / max(rates)
