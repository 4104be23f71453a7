"""Flights of a nano-drone with a VL53L5CX towards a wall, and the preset `vl53l5cx` in its place.

The flights are those of ETH-PBL/Matrix_ToF_Drones, licensed GPL-3, so they are not shipped. Vicon
gives the pose of drone and wall. A frame reaches the drone when the next one begins: the sensor
lags Vicon by one frame, as the slope of its error over the speed shows (64 to 71 ms in all three
flights). What the files do not say, reflectance and light on the wall, is chosen once, on the first
flight, from when the sensor loses the wall.
"""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.ranging import measure_ranges
from spisim.budget.link import Target, spot_link
from spisim.instrument import Instrument, SpotLight
from spisim.simulation.light.path_bins import bins_for, split_light

SENSOR, VICON = "state_ToF.csv", "state_Vicon.csv"
#: The four zones about the axis; one that is valid gives a range of the middle.
MIDDLE = np.array([27, 28, 35, 36])
ZONES = 64
#: Time stamps are larger than any range in mm.
MIN_TIME_MS = 20_000
#: Statuses of a valid range (UM2884).
VALID = 5, 6, 9
#: In flight; the wall ahead, met within its panel.
MIN_HEIGHT_M, MAX_OFF_DEG, PANEL_M = 0.15, 20.0, (0.5, 0.5)
RANGES_M = 0.2, 4.0
#: Light on the wall is unknown: of 4 to 6 klx this agrees best with the first flight, and the
#: figures of all three flights were in view when it was chosen.
REFLECTANCE, KLX = 0.5, 4.0


@dataclass(frozen=True, eq=False)
class Flight:
    """Frames before the wall: Vicon's range along the axis, and what the sensor gives."""

    range_m: Floats
    """(frames,): when the frame arrives."""
    measured_m: Floats
    """(frames,): while it is measured, one frame earlier."""
    sensor_m: Floats
    """(frames, 4): zones about the axis, nan where they are not valid."""

    @property
    def middle_m(self) -> Floats:
        """Ranges (frames,) of the middle, nan where the sensor gives none."""
        return middle_of(self.sensor_m)


def middle_of(ranges_m: Floats) -> Floats:
    """Median (frames,) of valid zones (frames, 4); nan where none is."""
    enough = np.isfinite(ranges_m).any(axis=1)
    median = np.full(len(ranges_m), np.nan)
    median[enough] = np.nanmedian(ranges_m[enough], axis=1)
    return median


def read_flight(folder: Path, frame_time_s: float) -> Flight:
    """The frames of a flight in which the wall is ahead."""
    for name in (SENSOR, VICON):
        if not (folder / name).is_file():
            raise InputError(f"{folder / name}: no such file; ETH-PBL/Matrix_ToF_Drones has it")
    times_ms, ranges_mm, statuses = _read_sensor(folder / SENSOR)
    poses = _read_vicon(folder / VICON)
    used, range_m = _ahead(poses, times_ms)
    _, measured_m = _ahead(poses, times_ms - 1e3 * frame_time_s)
    valid = np.isin(statuses[:, MIDDLE], VALID)
    sensor_m = np.where(valid, 1e-3 * ranges_mm[:, MIDDLE], np.nan)
    return Flight(range_m[used], measured_m[used], sensor_m[used])


def _ahead(poses: dict[str, Floats], times_ms: Floats) -> tuple[NDArray[np.bool_], Floats]:
    """Mask (frames,) of a wall ahead of a drone in flight, and its range (frames,)."""
    drone, surface = (_at(poses[name], times_ms) for name in ("Drone", "Surface"))
    axis = _forward(drone[:, 3:])
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = (surface[:, 0] - drone[:, 0]) / axis[:, 0]
        beside = np.abs(drone[:, :3] + range_m[:, None] * axis - surface[:, :3])[:, 1:]
    ahead = (drone[:, 2] > MIN_HEIGHT_M) & (axis[:, 0] > np.cos(np.radians(MAX_OFF_DEG)))
    near = (range_m > RANGES_M[0]) & (range_m < RANGES_M[1])
    return ahead & near & (beside < PANEL_M).all(axis=1), range_m


def _read_sensor(path: Path) -> tuple[Floats, Floats, NDArray[np.int64]]:
    """Times (frames,) in ms, ranges (frames, 64) in mm and statuses (frames, 64)."""
    table = np.loadtxt(path, delimiter=",", ndmin=2)
    heads = np.flatnonzero(table[:, 0] >= MIN_TIME_MS)
    if (np.diff([*heads, len(table)]) != ZONES + 1).any():
        raise InputError(f"{path}: should hold a time and {ZONES} zones for each frame")
    zones = table.reshape(-1, ZONES + 1, 3)[:, 1:]
    return table[heads, 0], zones[..., 0], zones[..., 2].astype(np.int64)


def _read_vicon(path: Path) -> dict[str, Floats]:
    """Rows (poses, 8) of time in ms, position and quaternion w, x, y, z, by object."""
    columns = "timeStamp", "posx", "posy", "posz", "qw", "qx", "qy", "qz"
    rows: dict[str, list[list[float]]] = {"Drone": [], "Surface": []}
    with path.open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            rows[row["name"]].append([float(row[name]) for name in columns])
    return {name: np.array(each) for name, each in rows.items()}


def _at(poses: Floats, times_ms: Floats) -> Floats:
    """The first pose at or after each time, without its time."""
    row = np.searchsorted(poses[:, 0], times_ms).clip(max=len(poses) - 1)
    return np.asarray(poses[row, 1:])


def _forward(quaternions: Floats) -> Floats:
    """The body's x axis (poses, 3) in the world."""
    w, x, y, z = quaternions.T
    return np.stack([1 - 2 * (y**2 + z**2), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)


def simulated(instrument: Instrument, range_m: Floats, seed: int, klx: float = KLX) -> Floats:
    """Ranges (frames, 4) of the zones about the axis of an instrument at these ranges of a wall."""
    link = spot_link(instrument, Target(range_m, REFLECTANCE, klx))
    lengths = bins_for(instrument.tof, np.full(1, np.nan)).centres_m
    rng = np.random.default_rng(seed)
    ranges = np.empty((range_m.size, MIDDLE.size))
    for frame in range(range_m.size):
        echo = np.zeros((1, ZONES, lengths.size))
        for zone in MIDDLE:
            each = slice(zone, zone + 1)
            rate = link.echo_per_s[frame, each]
            echo[0, zone] = split_light(link.path_m[frame, each], rate, lengths)
        steady = np.full((1, ZONES), link.steady_per_s[frame, MIDDLE].mean())
        light = SpotLight(lengths, echo, steady, instrument.zones.power_w)
        spots = instrument.tof.record(light, instrument.spot_optics, rng)
        ranges[frame] = measure_ranges(spots, 0, "dtof").range_m[MIDDLE]
    return ranges


def alike(flight: Flight, middle_m: Floats) -> Floats:
    """Whether (frames,) sensor and simulation both give a range, or neither."""
    return np.isfinite(flight.middle_m) == np.isfinite(middle_m)
