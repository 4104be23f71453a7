"""Poses as 4 x 4 matrices."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError

Vector3: TypeAlias = tuple[float, float, float]


def pose_matrix(rotate_deg: ArrayLike, translate_m: ArrayLike) -> Floats:
    """Matrix (4, 4) of a rotation followed by a translation.

    Parameters
    ----------
    rotate_deg : (3,)
        [roll, pitch, yaw] about the fixed x, y, z axes, in this order, degrees.
    translate_m : (3,)
        Translation, metres.
    """
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(
        "xyz", np.asarray(rotate_deg, float), degrees=True
    ).as_matrix()
    matrix[:3, 3] = translate_m
    return matrix


def moved_pose(
    pivot_m: ArrayLike, velocity_m_s: ArrayLike, angular_velocity_rad_s: ArrayLike, time_s: float
) -> Floats:
    """Rigid motion (4, 4) after `time_s`: turning about `pivot_m`, which moves too; world axes."""
    pivot = np.asarray(pivot_m, float)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(np.multiply(angular_velocity_rad_s, time_s)).as_matrix()
    matrix[:3, 3] = pivot + np.multiply(velocity_m_s, time_s) - matrix[:3, :3] @ pivot
    return matrix


def look_at(position_m: ArrayLike, target_m: ArrayLike, up: ArrayLike) -> Floats:
    """World-from-optical pose (4, 4) at a position, looking at a target.

    The optical frame has x right, y down, z forward.

    Parameters
    ----------
    position_m, target_m : (3,)
        World coordinates, metres.
    up : (3,)
        Direction that is up in the image; need not be normal to the line of sight.

    Raises
    ------
    InputError
        If the target is the position, or `up` is zero or along the line of sight.
    """
    position = np.asarray(position_m, float)
    forward = _unit(np.asarray(target_m, float) - position)
    if not forward.any():
        raise InputError("look_at_m should differ from position_m")
    right = np.cross(forward, _unit(np.asarray(up, float)))
    if np.linalg.norm(right) < 1e-6:
        raise InputError("up should not be zero or along the line of sight")
    right = _unit(right)
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([right, np.cross(forward, right), forward])
    matrix[:3, 3] = position
    return matrix


def _unit(vector: Floats) -> Floats:
    length = np.linalg.norm(vector)
    return vector / length if length > 0 else vector
