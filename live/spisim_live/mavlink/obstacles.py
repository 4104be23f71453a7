"""Fields of the messages that tell an autopilot of ranges and obstacles."""

from contextlib import suppress
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import Optics, Setup
from reconstruction.depth import (
    CORRIDOR_M,
    DISTANCES_M,
    MAX_RANGE_M,
    nearest_obstacle_m,
    pixel_rays,
)
from reconstruction.ranging import Ranges
from reconstruction.result import Result

from .readings import FRD_OF_OPTICAL

MIN_CM, MAX_CM = round(100 * DISTANCES_M[0]), round(100 * MAX_RANGE_M)
LASER = 0
"""MAV_DISTANCE_SENSOR_LASER."""
CUSTOM_ORIENTATION = 100
"""MAV_SENSOR_ROTATION_CUSTOM: the quaternion states the direction."""
BODY_FRD = 12
"""MAV_FRAME_BODY_FRD."""
INVALID, WORST, PERFECT = 1, 2, 100
"""Signal quality, in per cent: of a spot without a range, and bounds of others."""
WORST_RELATIVE_SIGMA = 0.2
"""Standard deviation over range of the worst quality of a range."""
UNKNOWN_VARIANCE, UNKNOWN_CM = 2**8 - 1, 2**16 - 1
NO_DISTANCE_CM = 0
"""Below the least distance, so that it is none."""
SECTORS = 72
SECTOR_DEG = 360 / SECTORS


def spot_fields(result: Result, setup: Setup, time_ms: int) -> list[dict[str, Any]]:
    """Fields of a DISTANCE_SENSOR of each spot."""
    ranges, spots = result.ranges, result.aimed(setup).spots
    if ranges is None or spots is None:
        return []
    return [
        {
            "time_boot_ms": time_ms,
            "min_distance": MIN_CM,
            "max_distance": MAX_CM,
            "current_distance": _distance_cm(ranges, spot),
            "type": LASER,
            "id": spot,
            "orientation": CUSTOM_ORIENTATION,
            "covariance": _variance_cm2(ranges, spot),
            "quaternion": _turn(FRD_OF_OPTICAL @ direction),
            "signal_quality": _quality(ranges, spot),
        }
        for spot, direction in enumerate(spots.directions)
    ]


def sector_fields(result: Result, setup: Setup, time_us: int) -> dict[str, Any] | None:
    """Fields of an OBSTACLE_DISTANCE; None without a depth map and corridors, or without optics.

    Sectors are centred about multiples of 5 degrees from straight ahead, clockwise; each has the
    nearest horizontal distance of its pixels within the corridor's height, and of the obstacle in
    the corridor along its middle: what a map does not show but no reading excludes is in the way.
    """
    if setup.optics is None or (result.depth_m is None and not result.corridors):
        return None
    nearest_cm = np.minimum(_of_corridors_cm(result), _of_map_cm(result, setup.optics))
    reported = np.where(np.isfinite(nearest_cm), np.minimum(nearest_cm, MAX_CM + 1), UNKNOWN_CM)
    return {
        "time_usec": time_us,
        "sensor_type": LASER,
        "distances": np.round(reported).astype(int).tolist(),
        "increment": round(SECTOR_DEG),
        "min_distance": MIN_CM,
        "max_distance": MAX_CM,
        "increment_f": SECTOR_DEG,
        "angle_offset": 0.0,
        "frame": BODY_FRD,
    }


def _of_map_cm(result: Result, optics: Optics) -> Floats:
    """Nearest distance (SECTORS,) of the depth map in the corridor's height; infinite if none."""
    nearest_cm = np.full(SECTORS, np.inf)
    if result.depth_m is None:
        return nearest_cm
    rays = pixel_rays(optics, result.depth_m.shape)
    depth_m = np.asarray(result.depth_m, np.float64)
    with np.errstate(invalid="ignore"):
        ahead = np.abs(rays[..., 1] * depth_m) <= CORRIDOR_M / 2  # not where depth is nan
    azimuth_deg = np.degrees(np.arctan(rays[..., 0]))
    sector = np.round(azimuth_deg / SECTOR_DEG).astype(int) % SECTORS
    horizontal_cm = 100 * depth_m * np.hypot(rays[..., 0], 1)
    np.minimum.at(nearest_cm, sector[ahead], horizontal_cm[ahead])
    return nearest_cm


def _of_corridors_cm(result: Result) -> Floats:
    """Distance (SECTORS,) of the obstacle in each corridor; infinite if none, or out of view."""
    nearest_cm = np.full(SECTORS, np.inf)
    if not result.corridors:
        return nearest_cm
    for sector in range(-SECTORS // 4 + 1, SECTORS // 4):
        azimuth = np.radians(sector * SECTOR_DEG)
        with suppress(InputError):  # out of view
            free = result.free_towards((np.sin(azimuth), 0.0, np.cos(azimuth)))
            nearest_cm[sector] = 100 * np.nan_to_num(
                nearest_obstacle_m(free, result.min_free), nan=np.inf
            )
    return nearest_cm


def _distance_cm(ranges: Ranges, spot: int) -> int:
    """Range in whole centimetres, `NO_DISTANCE_CM` if there is none."""
    if not ranges.valid[spot]:
        return NO_DISTANCE_CM
    return int(min(round(100 * ranges.range_m[spot]), UNKNOWN_CM))


def _variance_cm2(ranges: Ranges, spot: int) -> int:
    """Variance in whole cm², at least 1; `UNKNOWN_VARIANCE` if unknown or larger."""
    variance = np.nan_to_num(1e4 * ranges.sigma_m[spot] ** 2, nan=UNKNOWN_VARIANCE)
    return int(np.clip(np.ceil(variance.round(3)), 1, UNKNOWN_VARIANCE))


def _quality(ranges: Ranges, spot: int) -> int:
    """Quality in per cent, by sigma over range; `INVALID` without a range, as in fog."""
    if not ranges.valid[spot]:
        return INVALID
    badness = ranges.sigma_m[spot] / ranges.range_m[spot] / WORST_RELATIVE_SIGMA
    return round(PERFECT - (PERFECT - WORST) * float(np.clip(np.nan_to_num(badness, nan=1), 0, 1)))


def _turn(direction: Floats) -> list[float]:
    """Quaternion w, x, y, z that turns the body's x onto a direction (forward, right, down)."""
    x, y, z = direction / np.linalg.norm(direction)
    quaternion = np.array([1 + x, 0, -z, y])
    return [float(each) for each in quaternion / np.linalg.norm(quaternion)]
