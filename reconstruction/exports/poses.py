"""Poses of frames from a file, and rotations as quaternions."""

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats
from ..base.errors import InputError

COLUMNS = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")
UNIT_TOLERANCE = 0.01
"""Tolerance of a quaternion's length, for rounding."""
MAX_MAGNITUDE = 1e10
"""Maximum magnitude of all numbers; times may count from 1970."""
MAX_BYTES = 2**28

OPTICAL_IN_BODY = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""The optical frame (right, down, forward) in the body's (forward, left, up; ROS REP 103)."""


class TimestampedPose(NamedTuple):
    """Time of a frame, if known, and its pose (4, 4), from the optical frame to the world."""

    time_s: float | None
    pose: Floats


def read_poses(path: Path) -> list[TimestampedPose]:
    """Read poses of the optical frame in the format of the TUM RGB-D benchmark.

    Lines are ``timestamp tx ty tz qx qy qz qw``, or comments that begin with #. Raises InputError,
    naming file and line, for other lines and times that do not rise.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file of poses")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path}: {path.stat().st_size} bytes; at most {MAX_BYTES} of poses")
    poses: list[TimestampedPose] = []
    last_s = -math.inf
    text = path.read_text(encoding="utf-8", errors="replace")
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        time_s, pose = _row(f"{path}, line {number}", line.split())
        if time_s <= last_s:
            raise InputError(
                f"{path}, line {number}: time {time_s:.15g} must be later than the one before, "
                f"{last_s:.15g}"
            )
        last_s = time_s
        poses.append(TimestampedPose(time_s, pose))
    return poses


def _row(where: str, words: list[str]) -> tuple[float, Floats]:
    if len(words) != len(COLUMNS):
        raise InputError(
            f"{where}: {len(words)} columns, not {len(COLUMNS)}: {' '.join(COLUMNS)} are expected"
        )
    numbers = []
    for name, word in zip(COLUMNS, words, strict=True):
        try:
            number = float(word)
        except ValueError:
            number = math.nan
        if not abs(number) <= MAX_MAGNITUDE:
            raise InputError(
                f"{where}: {name} must be a number within ±{MAX_MAGNITUDE:g}; found {word[:80]!r}"
            )
        numbers.append(number)
    quaternion = np.array(numbers[4:])
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > UNIT_TOLERANCE:
        raise InputError(f"{where}: qx qy qz qw must have length 1, not {length:.4g}")
    pose = np.eye(4)
    pose[:3, :3] = rotation(quaternion / length)
    pose[:3, 3] = numbers[1:4]
    return numbers[0], pose


def rotation(quaternion: Floats) -> Floats:
    """Matrix (3, 3) of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_of(matrix: Floats) -> Floats:
    """Unit quaternion x, y, z, w of a rotation (3, 3), with w not negative.

    Computed from the largest squared component, which avoids cancellation (Shepperd, J. Guid.
    Control 1, 223 (1978)).
    """
    trace = np.trace(matrix)
    squares = np.array([*np.diag(matrix), trace])
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 3:
        q[3] = 1 + trace
        q[:3] = (
            matrix[2, 1] - matrix[1, 2],
            matrix[0, 2] - matrix[2, 0],
            matrix[1, 0] - matrix[0, 1],
        )
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q[i] = 1 - trace + 2 * matrix[i, i]
        q[j], q[k] = matrix[j, i] + matrix[i, j], matrix[k, i] + matrix[i, k]
        q[3] = matrix[k, j] - matrix[j, k]
    q /= np.linalg.norm(q)
    return np.asarray(q if q[3] >= 0 else -q)
