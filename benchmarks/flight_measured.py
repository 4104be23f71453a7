"""Flights of a nano-drone with an 8 × 8 sensor: does the memory predict the sensor's next frame?

The recordings of ETH-PBL/Matrix_ToF_Drones (GPL-3, not shipped) hold the ranges of a VL53L5CX and
the drone's pose by motion capture. Each zone's next range is predicted by the
points that the ranges before it met, and by the same zone's last range.
"""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from range_prediction import RangePrediction
from scipy.spatial.transform import Rotation, Slerp

from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture import Optics
from reconstruction.capture.motion import PoseAt
from reconstruction.depth.memory.points import RangeMemory
from reconstruction.depth.pixels import pixel_rays
from spisim_paper.checks import Check, Table

ZONES, HALF_FIELD_DEG = 8, 22.5
VALID = 1
SIGMA_M, RELATIVE_SIGMA = 0.015, 0.01
POSE_VARIANCE = 1e-6
FIRST, FLYING_M_S = 6, 0.05
MAX_RATIO = 0.8
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""Axes of the optical frame in those of the body: x forward, y left, z up."""


def measured_benchmark(folder: Path) -> tuple[list[Table], list[Check]]:
    """Median errors of both predictions, by flight and of all; empty without the folder."""
    flights = sorted(each.parent for each in folder.glob("*/state_ToF.csv"))
    if not flights:
        return [], []
    body, all_errors = [], []
    for flight in flights:
        errors = errors_of(flight)
        all_errors.append(errors)
        body.append((flight.name, *_cells(errors), *_cells(errors[:, errors[2] > FLYING_M_S])))
    whole = np.concatenate(all_errors, axis=1)
    flying = whole[:, whole[2] > FLYING_M_S]
    body.append(("all", *_cells(whole), *_cells(flying)))
    title = (
        "Nano-drone, VL53L5CX: median error in mm of a zone's next range by the memory, by the "
        "zone's last range, and their ratio; in all frames and in those that fly."
    )
    columns = ("flight", "memory", "last", "ratio", "flying: memory", "last", "ratio")
    ratios = {f"flight {each[0]}": float(each[3]) for each in body}
    checks = [
        Check(f"error of the predicted next range over that of the last, {name}", ratio, MAX_RATIO)
        for name, ratio in ratios.items()
    ]
    return [Table(title, columns, body)], checks


def _cells(errors: Floats) -> tuple[str, str, str]:
    memory, last = np.median(errors[:2], axis=1)
    return f"{1e3 * memory:.1f}", f"{1e3 * last:.1f}", f"{memory / last:.3f}"


def errors_of(folder: Path) -> Floats:
    """Errors of memory and last range in metres, and the drone's speed (3, N)."""
    times_s, range_m, valid = _ranges(folder / "state_ToF.csv")
    position_m, axes = _poses(folder / "state_Vicon.csv", times_s)
    tan = float(np.tan(np.radians(HALF_FIELD_DEG)))
    optics = Optics(tan_half_width=tan, tan_half_height=tan)
    shape = (ZONES, ZONES)
    rays = pixel_rays(optics, shape).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    prediction = RangePrediction(RangeMemory(optics, shape), rays)
    errors: list[Floats] = []
    for frame, (time_s, measured_m, sound) in enumerate(zip(times_s, range_m, valid, strict=True)):
        pose = PoseAt(time_s, position_m[frame], axes[frame], POSE_VARIANCE, POSE_VARIANCE)
        expected_m = prediction.at(pose)
        if frame >= FIRST:
            both = sound & valid[frame - 1] & np.isfinite(expected_m)
            step_m = np.linalg.norm(position_m[frame] - position_m[frame - 1])
            speed = step_m / max(time_s - times_s[frame - 1], 1e-3)
            by_memory = np.abs(expected_m - measured_m)[both]
            by_last = np.abs(range_m[frame - 1] - measured_m)[both]
            errors.append(np.array([by_memory, by_last, np.full(both.sum(), speed)]))
        known_m = np.where(sound, measured_m, np.nan)
        prediction.take(pose, known_m, SIGMA_M + RELATIVE_SIGMA * measured_m)
    return np.concatenate(errors, axis=1)


def _ranges(file: Path) -> tuple[Floats, Floats, Mask]:
    """Times (T,), ranges (T, 64) in metres, and which are valid."""
    rows = np.array(_read(file), dtype=float)
    blocks = rows[: len(rows) // (ZONES**2 + 1) * (ZONES**2 + 1)].reshape(-1, ZONES**2 + 1, 3)
    valid: Mask = (blocks[:, 1:, 1] == VALID) & (blocks[:, 1:, 0] > 0)
    return blocks[:, 0, 0] / 1e3, blocks[:, 1:, 0] / 1e3, valid


def _poses(file: Path, times_s: Floats) -> tuple[Floats, Floats]:
    """Positions (T, 3) and axes (T, 3, 3) of the optical frame at these times."""
    rows = np.array([row[1:] for row in _read(file)[1:] if row[0] == "Drone"], dtype=float)
    recorded_s = rows[:, 0] / 1e3
    later = np.append(True, recorded_s[1:] > np.maximum.accumulate(recorded_s)[:-1])
    recorded_s, rows = recorded_s[later], rows[later]
    within_s = np.clip(times_s, recorded_s[0], recorded_s[-1])
    position_m = np.stack([np.interp(within_s, recorded_s, rows[:, k]) for k in (1, 2, 3)], axis=1)
    turns = Slerp(recorded_s, Rotation.from_quat(rows[:, [5, 6, 7, 4]]))(within_s)
    return position_m, turns.as_matrix() @ OPTICAL


def _read(file: Path) -> Sequence[Sequence[str]]:
    with file.open(newline="") as lines:
        return list(csv.reader(lines))
