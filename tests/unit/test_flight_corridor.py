"""Corridors in any direction, and the ranges that remembered points predict."""

from types import SimpleNamespace

import numpy as np
import pytest
from range_prediction import RangePrediction

from reconstruction.base.errors import InputError
from reconstruction.capture import Optics
from reconstruction.capture.motion import PoseAt
from reconstruction.depth import DepthEstimate, nearest_obstacle_m
from reconstruction.depth.ahead import Ahead
from reconstruction.depth.memory.points import RangeMemory
from reconstruction.depth.obstacle import CorridorPrior
from reconstruction.depth.pixels import pixel_rays

OPTICS = Optics(tan_half_width=0.4, tan_half_height=0.4)
SHAPE = (8, 8)
RAYS = pixel_rays(OPTICS, SHAPE).reshape(-1, 3)
UNIT = RAYS / np.linalg.norm(RAYS, axis=1, keepdims=True)


def pose(time_s=0.0, position_m=(0.0, 0.0, 0.0)):
    return PoseAt(time_s, np.array(position_m), np.eye(3), 1e-6, 1e-6)


def wall(distance_m, offset_m=0.0):
    """Ranges of a wall across the optical axis, with an error of the sensor."""
    return distance_m / UNIT[:, 2] + offset_m


@pytest.mark.parametrize("offset_m", [0.0, 0.1])
def test_the_next_ranges_follow_from_points_and_the_sensors_own_error(offset_m):
    rng = np.random.default_rng(5)
    of_zone = offset_m * rng.standard_normal(len(UNIT))
    prediction = RangePrediction(RangeMemory(OPTICS, SHAPE), UNIT)
    assert np.isnan(prediction.at(pose())).all()
    errors, last = [], []
    before = None
    for frame in range(40):
        at = pose(0.05 * frame, (0, 0, 0.05 * frame))
        range_m = wall(4 - 0.05 * frame, of_zone) + 0.005 * rng.standard_normal(len(UNIT))
        if frame > 10:
            errors.append(np.abs(prediction.at(at) - range_m))
            last.append(np.abs(before - range_m))
        prediction.take(at, range_m, np.full(len(UNIT), 0.02))
        before = range_m
    assert np.nanmedian(errors) < 0.4 * np.median(last)


@pytest.mark.parametrize(("sign", "fraction"), [(1, 1.0), (-1, 0.0)])
def test_all_of_a_steady_error_returns_and_nothing_of_one_that_alternates(sign, fraction):
    points = SimpleNamespace(along=lambda *_: np.full(len(UNIT), 4.0), add=lambda *_: None)
    prediction, away = RangePrediction(points, UNIT), 0.03 * np.linspace(-1, 1, len(UNIT))
    for frame in range(6):
        range_m = 4.0 * np.exp(sign**frame * away)
        prediction.take(pose(), range_m, np.full(len(UNIT), 0.02))
    np.testing.assert_allclose(prediction.at(pose()), 4.0 * (range_m / 4.0) ** fraction)


def test_a_range_that_wanders_while_the_drone_stands_still_is_the_next_one():
    prediction, rng = RangePrediction(RangeMemory(OPTICS, SHAPE), UNIT), np.random.default_rng(6)
    range_m, errors, last = wall(4.0), [], []
    for frame in range(60):
        stepped_m = range_m + 0.02 * rng.standard_normal(len(UNIT))
        if frame > 20:
            errors.append(np.abs(prediction.at(pose(0.05 * frame)) - stepped_m))
            last.append(np.abs(range_m - stepped_m))
        prediction.take(pose(0.05 * frame), stepped_m, np.full(len(UNIT), 0.02))
        range_m = stepped_m
    assert np.median(errors) < 1.1 * np.median(last)


def test_a_zone_without_a_range_is_predicted_by_its_neighbours_points():
    prediction = RangePrediction(RangeMemory(OPTICS, SHAPE), UNIT)
    range_m = wall(3.0)
    range_m[::2] = np.nan
    prediction.take(pose(), range_m, np.full(len(UNIT), 0.01))
    np.testing.assert_allclose(prediction.at(pose(0.1)), wall(3.0), rtol=0.01)


SIDE = np.array([0.2, 0.0, 1.0])


def wall_with_a_gap(x_m):
    """Depths of a wall at 3 m, and at 12 m where x is within 0.5 m of this at the wall."""
    x = 3.0 * pixel_rays(OPTICS, (32, 32))[..., 0]
    return np.where(np.abs(x - x_m) < 0.5, 12.0, 3.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_corridor_through_a_gap_is_free_beside_the_wall(axis):
    depth_m = wall_with_a_gap(3.0 * SIDE[0])
    direction = SIDE if axis == 0 else SIDE[[1, 0, 2]]
    depth_m = depth_m if axis == 0 else depth_m.T
    prior = CorridorPrior(0.0, 1.0, 0.05, 0.0, 0.3)
    ahead = Ahead(pixel_rays(OPTICS, (32, 32)), depth_m, np.full((32, 32), 0.02), None, prior)
    assert nearest_obstacle_m(ahead.free()) == pytest.approx(3.0, rel=0.1)
    length = np.linalg.norm(direction)
    assert nearest_obstacle_m(ahead.free(direction)) == pytest.approx(12 * length, rel=0.1)
    assert nearest_obstacle_m(ahead.free(-3 * direction * [1, 1, -1])) == pytest.approx(
        3 * length, rel=0.1
    )


@pytest.mark.parametrize(
    ("direction", "message"),
    [
        ((0.5, 0, 1), r"out of view; x / z is at most 0\.35"),
        ((0, -0.5, 1), "y / z at most"),
        ((0, 0, -1), "with z > 0"),
        ((0, 0, 0), "not all zero"),
        ((0, np.nan, 1), "three finite numbers"),
        ((0, 1), "three finite numbers"),
    ],
)
def test_a_corridor_that_leads_out_of_view_is_refused(direction, message):
    with pytest.raises(InputError, match=message):
        Ahead.of(
            DepthEstimate(np.full(SHAPE, 3.0), np.full(SHAPE, 0.1)),
            pixel_rays(OPTICS, SHAPE),
            "learned",
        ).free(direction)
