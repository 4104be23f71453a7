"""Poses requested of a simulated drone, sent back (docs/reference/stream-format.md)."""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from reconstruction.base.errors import InputError

from .framing import Kind, Message, pack

POSE = struct.Struct("<7d")
MAX_M = 1e6
UNIT_TOLERANCE = 0.01
"""Tolerance of a quaternion's length, for rounding."""


class Pose(NamedTuple):
    """A position (x, y, z) in m and an attitude, a unit quaternion (x, y, z, w).

    In axes of the drone's body at the beginning of the stream: x forward, y left, z up (ROS REP
    103).
    """

    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


def command(pose: Pose | None, number: int, time_ns: int = 0) -> bytes:
    """Message that requests a frame at a pose; None keeps the last pose."""
    payload = b"" if pose is None else POSE.pack(*pose.position_m, *pose.quaternion)
    return pack(Message(Kind.COMMAND, payload, number, time_ns))


def pose_of(payload: bytes) -> Pose | None:
    """Pose of a command; raises InputError for an invalid payload."""
    if not payload:
        return None
    if len(payload) != POSE.size:
        raise InputError(f"a pose of {len(payload)} bytes; must have {POSE.size}, or none")
    x, y, z, *quaternion = POSE.unpack(payload)
    position = (x, y, z)
    if not all(abs(value) <= MAX_M for value in position):  # nan is not
        raise InputError(f"position {_vector_text(position)} m; must lie within ±{MAX_M:g}")
    length = math.hypot(*quaternion)
    if not abs(length - 1) <= UNIT_TOLERANCE:
        raise InputError(f"quaternion {_vector_text(quaternion)}; must have length 1")
    qx, qy, qz, qw = (value / length for value in quaternion)
    return Pose(position, (qx, qy, qz, qw))


def _vector_text(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:g}' for value in values)})"
