"""Flights of a nano-drone with an 8 × 8 sensor: what does the past say about the next frame?

The recordings of ETH-PBL/Matrix_ToF_Drones (GPL-3, not shipped) hold the ranges of a VL53L5CX and
the drone's pose by motion capture. Each zone's next range is predicted by filters of its ranges
(`range_prediction`), and by two references: its last range, and the point that it met last, seen
from the next pose. The references are what is known without any memory.
"""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from range_prediction import RangePrediction
from scipy.spatial.transform import Rotation, Slerp

from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture import Optics
from reconstruction.depth.pixels import pixel_rays
from spisim_paper.checks import Check, Table

ZONES, HALF_FIELD_DEG = 8, 22.5
VALID = 1
FIRST, FLYING_M_S = 6, 0.05
TAIL = 90
"""Percentile of the large errors."""
OVER_LAST, OVER_MOVED, TAIL_OVER_BOTH = 0.8, 0.95, 1.0
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
"""Axes of the optical frame in those of the body: x forward, y left, z up."""


def measured_benchmark(folder: Path) -> tuple[list[Table], list[Check]]:
    """Errors of all predictions, by flight and of all; empty without the folder."""
    errors = _by_flight(folder)
    if not errors:
        return [], []
    title = (
        "Nano-drone, VL53L5CX: error in mm of a zone's next range, median / 90th percentile, by "
        "filters, by the point that the zone met last as the next pose sees it, and by its last "
        "range; and the filters' over the moved point's, in all frames and in those that fly."
    )
    columns = "flight", "ranges", "filters", "moved", "last", "filters / moved", "flying"
    return [Table(title, columns, [_row(*each) for each in errors.items()])], [*_promises(errors)]


def nano_drone_checks(folder: Path) -> Iterator[Check]:
    """Errors of the filters relative to those of the references; none without the folder."""
    return _promises(_by_flight(folder))


def _by_flight(folder: Path) -> dict[str, Floats]:
    flights = sorted(each.parent for each in folder.glob("*/state_ToF.csv"))
    errors = {flight.name: errors_of(flight) for flight in flights}
    return errors | {"all": np.concatenate([*errors.values()], axis=1)} if errors else {}


def _promises(errors: dict[str, Floats]) -> Iterator[Check]:
    for name, each in errors.items():
        (median, tail), (moved, moved_tail), (last, last_tail) = _typical(each)
        what = f"next range, flight {name}: error over that of the"
        yield Check(f"{what} last range", median / last, OVER_LAST)
        yield Check(f"{what} moved point", median / moved, OVER_MOVED)
        ratio = tail / min(moved_tail, last_tail)
        yield Check(f"{what} better of both, {TAIL}th percentile", ratio, TAIL_OVER_BOTH)


def _typical(errors: Floats) -> Floats:
    """Median and 90th percentile (3, 2) of the errors in metres of the three predictions."""
    return np.percentile(errors[:3], (50, TAIL), axis=1).T


def _row(name: str, errors: Floats) -> tuple[str, ...]:
    flying = errors[:, errors[3] > FLYING_M_S]
    typical = (1e3 * _typical(errors)).tolist()
    ratios = [_typical(each)[0] / _typical(each)[1] for each in (errors, flying)]
    cells = ["{:.1f} / {:.1f}".format(*each) for each in typical]
    return name, f"{errors.shape[1]}", *cells, *("{:.3f} / {:.3f}".format(*each) for each in ratios)


def errors_of(folder: Path) -> Floats:
    """Errors of filters, moved point and last range in metres, and the drone's speed (4, N)."""
    times_s, range_m, valid = _ranges(folder / "state_ToF.csv")
    position_m, axes = _poses(folder / "state_Vicon.csv", times_s)
    tan = float(np.tan(np.radians(HALF_FIELD_DEG)))
    optics = Optics(tan_half_width=tan, tan_half_height=tan)
    prediction = RangePrediction(optics, (ZONES, ZONES))
    rays = pixel_rays(optics, (ZONES, ZONES)).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    errors: list[Floats] = []
    for frame in range(len(times_s)):
        # The sensor states depths: a wall across its axis has the same in all zones.
        expected_m = prediction.at(position_m[frame], axes[frame])
        prediction.take(np.where(valid[frame], range_m[frame], np.nan))
        if frame < FIRST:
            continue
        both = valid[frame] & valid[frame - 1]
        met_m = position_m[frame - 1] + (rays * range_m[frame - 1][:, None]) @ axes[frame - 1].T
        # As a range along the zone, though it is a depth: so the moved point errs less.
        moved_m = np.linalg.norm(met_m - position_m[frame], axis=1)
        step_m = np.linalg.norm(position_m[frame] - position_m[frame - 1])
        speed = step_m / max(times_s[frame] - times_s[frame - 1], 1e-3)
        off_m = np.abs(np.stack([expected_m, moved_m, range_m[frame - 1]]) - range_m[frame])
        errors.append(np.vstack([off_m[:, both], np.full(both.sum(), speed)]))
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
