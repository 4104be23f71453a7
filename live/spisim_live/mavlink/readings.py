"""What messages say of the pose, in the axes of a capture.

MAVLink has north, east, down and a body of forward, right, down; here the world is east, north, up
(ROS REP 103), and the optical frame right, down, forward, with the camera along the body's x.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.poses import check_covariances
from reconstruction.exports.poses import quaternion_of, rotation

WORLD_OF_NED = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])
"""East, north, up of north, east, down."""
FRD_OF_OPTICAL = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""Forward, right, down of right, down, forward."""
LOCAL_NED = 1
"""MAV_FRAME_LOCAL_NED."""
MAX_M = 1e6
UNIT_TOLERANCE = 0.01
"""Tolerance of a quaternion's length, for rounding."""


class Reading(NamedTuple):
    """Part of a pose at a time of the sender's clock; what a message does not tell is None.

    ``covariance`` (6, 6) is as in `reconstruction.capture.Poses`.
    """

    time_s: float
    position_m: Floats | None = None
    orientation: Floats | None = None
    covariance: Floats | None = None


def reading_of(message: Any) -> Reading | None:
    """Return what a message says, None if it is not about the pose; InputError for bad numbers."""
    kind = message.get_type()
    return READERS[kind](message) if kind in READERS else None


def _attitude(message: Any) -> Reading:
    half = [angle / 2 for angle in (message.roll, message.pitch, message.yaw)]
    if not all(map(math.isfinite, half)):
        raise InputError("ATTITUDE has angles that are not finite")
    (sr, sp, sy), (cr, cp, cy) = map(math.sin, half), map(math.cos, half)
    quaternion = (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    return Reading(message.time_boot_ms / 1e3, orientation=_orientation("ATTITUDE", quaternion))


def _attitude_quaternion(message: Any) -> Reading:
    quaternion = (message.q1, message.q2, message.q3, message.q4)
    orientation = _orientation("ATTITUDE_QUATERNION", quaternion)
    return Reading(message.time_boot_ms / 1e3, orientation=orientation)


def _local_position(message: Any) -> Reading:
    return Reading(message.time_boot_ms / 1e3, _position("LOCAL_POSITION_NED", message))


def _odometry(message: Any) -> Reading:
    if message.frame_id != LOCAL_NED:
        raise InputError(
            f"ODOMETRY has frame_id {message.frame_id}; used is {LOCAL_NED}, MAV_FRAME_LOCAL_NED"
        )
    if message.quality < 0:
        raise InputError(f"ODOMETRY has quality {message.quality}: it has failed")
    return Reading(
        message.time_usec / 1e6,
        _position("ODOMETRY", message),
        _orientation("ODOMETRY", message.q),
        _covariance("ODOMETRY", message.pose_covariance),
    )


READERS: dict[str, Callable[[Any], Reading]] = {
    "ATTITUDE": _attitude,
    "ATTITUDE_QUATERNION": _attitude_quaternion,
    "LOCAL_POSITION_NED": _local_position,
    "ODOMETRY": _odometry,
}
"""Readers of messages by their names."""


def _position(kind: str, message: Any) -> Floats:
    ned = np.array([message.x, message.y, message.z])
    if not (np.abs(ned) <= MAX_M).all():  # nan is not
        raise InputError(f"{kind} has position {ned.tolist()} m; must lie within ±{MAX_M:g}")
    return np.asarray(WORLD_OF_NED @ ned)


def _orientation(kind: str, quaternion: Sequence[float]) -> Floats:
    """Orientation of the optical frame from a quaternion w, x, y, z of the body."""
    w, *vector = quaternion
    xyzw = np.array([*vector, w])
    length = float(np.linalg.norm(xyzw))
    if not abs(length - 1) <= UNIT_TOLERANCE:
        raise InputError(f"{kind} has quaternion {list(quaternion)}; must have length 1")
    return quaternion_of(WORLD_OF_NED @ rotation(xyzw / length) @ FRD_OF_OPTICAL)


def _covariance(kind: str, upper: Sequence[float]) -> Floats | None:
    """Covariance from the upper triangle's rows; None if it is unknown.

    Unknown ones have a nan, or variances of 0, as of autopilots that leave the field empty.
    """
    rows, columns = np.triu_indices(6)
    ned = np.zeros((6, 6))
    ned[rows, columns] = ned[columns, rows] = upper
    if not np.isfinite(ned).all():
        return None
    check_covariances(f"{kind}: pose_covariance", ned)
    if not np.diag(ned).all():
        return None
    turn = np.zeros((6, 6))
    turn[:3, :3], turn[3:, 3:] = WORLD_OF_NED, FRD_OF_OPTICAL.T
    return np.asarray(turn @ ned @ turn.T)
