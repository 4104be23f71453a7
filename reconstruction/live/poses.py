"""Commands of a pose, back to whoever sends the frames (docs/reference/stream-format.md)."""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from ..base.errors import InputError
from .framing import Kind, Message, pack

POSE = struct.Struct("<7d")
MAX_M = 1e6
UNIT_TOLERANCE = 0.01
"""Quaternions may be off unit length by rounding."""


class Pose(NamedTuple):
    """A place (x, y, z) in m and an attitude, a unit quaternion (x, y, z, w).

    In axes of the drone's body where the stream began: x forward, y left, z up (ROS REP 103).
    """

    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


def command(pose: Pose | None, number: int, time_ns: int = 0) -> bytes:
    """A message that asks for the frame of this number, and tells where to be; None: as before."""
    payload = b"" if pose is None else POSE.pack(*pose.position_m, *pose.quaternion)
    return pack(Message(Kind.COMMAND, payload, number, time_ns))


def pose_of(payload: bytes) -> Pose | None:
    """What a command tells; InputError for a payload that is no pose."""
    if not payload:
        return None
    if len(payload) != POSE.size:
        raise InputError(f"a pose of {len(payload)} bytes; it has {POSE.size}, or none")
    x, y, z, *quaternion = POSE.unpack(payload)
    position = (x, y, z)
    if not all(abs(value) <= MAX_M for value in position):  # nan is not
        raise InputError(f"position {_reported(position)} m; should lie within ±{MAX_M:g}")
    length = math.hypot(*quaternion)
    if not abs(length - 1) <= UNIT_TOLERANCE:
        raise InputError(f"quaternion {_reported(quaternion)}; should be of length 1")
    qx, qy, qz, qw = (value / length for value in quaternion)
    return Pose(position, (qx, qy, qz, qw))


def _reported(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:g}' for value in values)})"
