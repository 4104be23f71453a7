"""Flights: timestamped drone poses from files, interpolated smoothly."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, naming, nearest
from reconstruction.ranging.weather import Weather
from spisim.base.config import find_named, read_text, shipped
from spisim.scene.description import DroneState
from spisim.scene.model import Scene
from spisim.scene.motion import MAX_TURN_RAD, check_steps, meeting_time
from spisim.scene.pose import Vector3, look_at
from spisim.scene.rays import enclosing_object

#: Frames that quaternions of a file rotate: the drone's body (x forward, y left, z up; ROS REP 103)
#: or its optical frame (x right, y down, z forward). Columns: the optical axes in that frame.
FRAMES = {
    "body": Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
    "optical": Rotation.identity(),
}
POSES = ("t", "x", "y", "z", "qx", "qy", "qz", "qw")
WAY_POINTS = ("t", "x", "y", "z", "look_x", "look_y", "look_z")
#: Rounding tolerance of a unit quaternion's length.
UNIT_TOLERANCE = 0.01
#: Maximum of all numbers in a file; times may count from 1970.
MAX_NUMBER = 1e10
#: Minimum interval between two times, s.
MIN_INTERVAL_S = 1e-6
#: A comment with the weather of the flight, as in an instrument's file.
WEATHER = re.compile(r"#\s*weather\s*[:=]\s*(.*)", re.IGNORECASE)
#: Maximum length of a straight step along a path.
STEP_M = 0.05


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A flight from 0 to `duration_s` through timestamped poses.

    Positions (3,) in the world follow a natural cubic spline, orientations (world from optical
    frame) a spline of continuous angular acceleration. `weather` is what ranging assumes: "clear",
    "fog", "unknown" or a visibility in metres; None if not stated.
    """

    positions_m: CubicSpline
    orientations: RotationSpline
    weather: str | None = None

    @classmethod
    def through(
        cls, times_s: Floats, positions_m: Floats, turns: Rotation, weather: str | None = None
    ) -> Trajectory:
        """Flight through positions (n, 3) and rotations (n,) at rising times (n,), n ≥ 2."""
        times = times_s - times_s[0]
        path = CubicSpline(times, positions_m, bc_type="natural")
        return cls(path, RotationSpline(times, turns), weather)

    @property
    def duration_s(self) -> float:
        """Duration of the flight."""
        return float(self.positions_m.x[-1])

    @property
    def times_s(self) -> Floats:
        """Times (n,) of the given poses, from 0."""
        return np.asarray(self.positions_m.x)

    @property
    def digest(self) -> str:
        """SHA-256 of times and poses."""
        values = (self.times_s, self.positions_m(self.times_s))
        turns = self.orientations(self.times_s).as_quat()
        return hashlib.sha256(b"".join(each.tobytes() for each in (*values, turns))).hexdigest()

    def faster(self, factor: float) -> Trajectory:
        """The same path in 1 / `factor` of the time."""
        times = self.times_s
        return Trajectory.through(
            times / factor,
            np.asarray(self.positions_m(times)),
            self.orientations(times),
            self.weather,
        )

    def pose(self, time_s: float) -> Floats:
        """World-from-optical pose (4, 4); InputError for a time outside the flight."""
        self._check(time_s)
        matrix = np.eye(4)
        matrix[:3, :3] = self.orientations(time_s).as_matrix()
        matrix[:3, 3] = self.positions_m(time_s)
        return matrix

    def velocity(self, time_s: float) -> Floats:
        """Velocity (3,), m/s, in world axes; InputError as `pose`."""
        self._check(time_s)
        return np.asarray(self.positions_m(time_s, 1), dtype=np.float64)

    def angular_velocity(self, time_s: float) -> Floats:
        """Angular velocity (3,), rad/s, about world axes; InputError as `pose`."""
        self._check(time_s)
        own_axes = self.orientations(time_s, 1)
        return np.asarray(self.orientations(time_s).apply(own_axes), dtype=np.float64)

    def drone_state(self, time_s: float) -> DroneState:
        """The drone at a time, as a section of a scene file; InputError as `pose`."""
        pose = self.pose(time_s)
        return DroneState(
            time_s=time_s,
            position_m=_vector(pose[:3, 3]),
            look_at_m=_vector(pose[:3, 3] + pose[:3, 2]),
            up=_vector(-pose[:3, 1]),
            velocity_m_s=_vector(self.velocity(time_s)),
            angular_velocity_deg_s=_vector(np.degrees(self.angular_velocity(time_s))),
        )

    def _check(self, time_s: float) -> None:
        if not 0 <= time_s <= self.duration_s:
            raise InputError(
                f"time {time_s:g} s is outside of the flight, 0 to {self.duration_s:g} s"
            )


def _vector(values: Floats) -> Vector3:
    x, y, z = values.tolist()
    return x, y, z


def load_trajectory(path: str | Path, frame: str = "body") -> Trajectory:
    """Load a flight from a file of poses or waypoints, or a shipped one by its name.

    Parameters
    ----------
    path : str or Path
        CSV with a header, `t,x,y,z,qx,qy,qz,qw` (s, m, unit quaternion) or
        `t,x,y,z,look_x,look_y,look_z` (point looked at, z up), or the format of the TUM RGB-D
        benchmark: lines `timestamp tx ty tz qx qy qz qw`. Lines that begin with # are comments,
        but `# weather: fog` states what ranging assumes: clear, fog, unknown or a visibility in
        metres. The first time is the start.
    frame : str
        Frame that the quaternions rotate into the world, one of `FRAMES`.

    Raises
    ------
    InputError
        Names file and line, for an unreadable file, wrong columns, values that are not finite
        numbers, unknown weather, times that do not rise, quaternions of the wrong length, a
        waypoint without a view, and fewer than two poses.
    """
    file = find_named(str(path), shipped("scenes"), "flight", (".csv", ".txt", ".tum"))
    if frame not in FRAMES:
        raise InputError(f"unknown frame {frame!r}: {nearest(frame, FRAMES)}")
    text = read_text(file, "CSV or TUM poses")
    numbers, columns, values = _read(file, text)
    if len(values) < 2:
        raise InputError(f"{file}: a flight needs 2 poses or more, not {len(values)}")
    table = np.array(values)
    not_rising = np.flatnonzero(np.diff(table[:, 0]) < MIN_INTERVAL_S)
    if not_rising.size:
        row = not_rising[0] + 1
        raise InputError(
            f"{file}, line {numbers[row]}: time {table[row, 0]:.15g} should be later than the one "
            f"before, {table[row - 1, 0]:.15g}"
        )
    if columns == WAY_POINTS:
        turns = _towards(file, numbers, table)
    else:
        turns = _of_quaternions(file, numbers, table[:, 4:]) * FRAMES[frame]
    return Trajectory.through(table[:, 0], table[:, 1:4], turns, _weather(file, text))


def _weather(file: Path, text: str) -> str | None:
    """Weather stated in the comments of a file, or None."""
    stated: dict[str, int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if match := WEATHER.fullmatch(line.strip()):
            with naming(f"{file}, line {number}"):
                Weather.parsed(match[1])
            stated[match[1]] = number
    if len(stated) > 1:
        raise InputError(
            f"{file}, line {max(stated.values())}: the weather is already stated differently: "
            f"{' and '.join(map(repr, stated))}"
        )
    return next(iter(stated), None)


def _read(file: Path, text: str) -> tuple[list[int], tuple[str, ...], list[list[float]]]:
    """Line numbers, column names and rows of a file."""
    lines = list(_lines(text))
    if not lines:
        raise InputError(f"{file}: the file is empty")
    columns: tuple[str, ...] = POSES
    separator = None
    number, first = lines[0]
    if "," in first:
        separator = ","
        columns = tuple(name.strip() for name in first.split(separator))
        if columns not in (POSES, WAY_POINTS):
            raise InputError(
                f"{file}, line {number}: the header should be {','.join(POSES)} or "
                f"{','.join(WAY_POINTS)}, not {first[:80]}"
            )
        lines = lines[1:]
    rows = [_row(f"{file}, line {n}", line.split(separator), columns) for n, line in lines]
    return [n for n, _ in lines], columns, rows


def _lines(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip() and not line.lstrip().startswith("#"):
            yield number, line.strip()


def _row(where: str, cells: list[str], columns: Sequence[str]) -> list[float]:
    if len(cells) != len(columns):
        raise InputError(
            f"{where}: {len(cells)} columns; expected {len(columns)}: {' '.join(columns)}"
        )
    values = []
    for name, cell in zip(columns, cells, strict=True):
        try:
            values.append(float(cell))
        except ValueError:
            raise InputError(f"{where}: {name} should be a number; found {cell!r}") from None
        if not math.isfinite(values[-1]):
            raise InputError(f"{where}: {name} should be finite; found {cell!r}")
        if abs(values[-1]) > MAX_NUMBER:
            raise InputError(f"{where}: {name} should lie within ±{MAX_NUMBER:g}; found {cell!r}")
    return values


def _of_quaternions(file: Path, numbers: list[int], quaternions: Floats) -> Rotation:
    lengths = np.linalg.norm(quaternions, axis=1)
    wrong = np.flatnonzero(np.abs(lengths - 1) > UNIT_TOLERANCE)
    if wrong.size:
        row = wrong[0]
        raise InputError(
            f"{file}, line {numbers[row]}: the quaternion qx qy qz qw should be of length 1, not "
            f"{lengths[row]:.4g}"
        )
    return Rotation.from_quat(quaternions)


def _towards(file: Path, numbers: list[int], table: Floats) -> Rotation:
    """Optical frames that look from each waypoint to its point."""
    matrices = []
    for number, row in zip(numbers, table, strict=True):
        try:
            matrices.append(look_at(row[1:4], row[4:], (0, 0, 1))[:3, :3])
        except InputError:
            raise InputError(
                f"{file}, line {number}: look_x look_y look_z should be a point that is neither "
                "the waypoint nor straight above or below it"
            ) from None
    return Rotation.from_matrix(matrices)


def check_clear_path(scene: Scene, trajectory: Trajectory) -> None:
    """Check that a flight neither begins inside an object nor crosses a surface that may move.

    Raises
    ------
    InputError
        Names object and time of the collision.
    """
    start = trajectory.pose(0.0)[:3, 3]
    if name := enclosing_object(scene, start):
        raise InputError(f"scene {scene.name!r}: the flight begins inside object {name!r}")
    times = trajectory.times_s
    fine = np.linspace(0, times[-1], 20 * len(times))
    length = np.linalg.norm(np.diff(trajectory.positions_m(fine), axis=0), axis=1).sum()
    rates = [np.linalg.norm(thing.angular_velocity_rad_s) for thing in scene.objects]
    turn = max(rates) * trajectory.duration_s
    steps = 20 * len(times) + np.ceil(length / STEP_M) + np.ceil(turn / MAX_TURN_RAD)
    check_steps(steps, f"scene {scene.name!r}: the drone or an object, during the flight,")
    fine = np.linspace(0, times[-1], int(steps))
    path = trajectory.positions_m(fine)
    meetings = {thing.name: meeting_time(thing, fine, path) for thing in scene.objects}
    name = min(meetings, key=lambda name: meetings[name])
    if meetings[name] < np.inf:
        raise InputError(
            f"scene {scene.name!r}: the flight leads through object {name!r} at "
            f"{meetings[name]:.3g} s; change the path, or move the object"
        )
