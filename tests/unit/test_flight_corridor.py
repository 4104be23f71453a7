"""Remembered points in the corridor, and the ranges that remembered points predict."""

from dataclasses import replace

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from reconstruction.capture import Optics
from reconstruction.capture.motion import PoseAt
from reconstruction.depth import DISTANCES_M, nearest_obstacle_m
from reconstruction.depth.ahead import Ahead
from reconstruction.depth.memory.flight import local_points
from reconstruction.depth.memory.obstacles import (
    LocalPoints,
    Met,
    MetObstacles,
    free_of_met,
    met_in_corridor,
)
from reconstruction.depth.memory.points import Points, RangeMemory
from reconstruction.depth.memory.prediction import RangePrediction
from reconstruction.depth.obstacle import CorridorPrior
from reconstruction.depth.pixels import pixel_rays

OPTICS = Optics(tan_half_width=0.4, tan_half_height=0.4)
SHAPE = (8, 8)
RAYS = pixel_rays(OPTICS, SHAPE).reshape(-1, 3)
UNIT = RAYS / np.linalg.norm(RAYS, axis=1, keepdims=True)


def pose(time_s=0.0, position_m=(0.0, 0.0, 0.0)):
    return PoseAt(time_s, np.array(position_m), np.eye(3), 1e-6, 1e-6)


def points(position_m, time_s):
    position_m, time_s = np.array(position_m, float), np.array(time_s, float)
    return Points(position_m, *(np.full(len(time_s), 1e-4),), time_s, *(np.zeros((2, len(time_s)))))


def test_points_in_the_corridor_are_met_also_where_the_view_does_not_reach():
    ahead = points([(0.29, -0.29, 0.3), (0.31, 0, 2), (0, 0, -1), (0.1, 0, 4)], [0, 0, 0, 1])
    met = met_in_corridor(local_points(ahead, pose(time_s=2.0)))
    np.testing.assert_allclose(met.depth_m, [0.3, 4.0])
    np.testing.assert_allclose(met.age_s, [2.0, 1.0])
    moved = met_in_corridor(local_points(ahead, pose(time_s=2.0, position_m=(0.1, 0, 1))))
    np.testing.assert_allclose(moved.depth_m, [1.0, 3.0])


def test_beyond_what_was_met_the_corridor_is_blocked_as_surely_as_it_is_recent():
    constants = MetObstacles(certainty=0.8, lasting_s=2.0)
    free = free_of_met(Met(np.array([3.0, 5.0]), np.array([2.0, 0.0])), constants)
    near, between, far = DISTANCES_M <= 3, (DISTANCES_M > 3) & (DISTANCES_M <= 5), DISTANCES_M > 5
    assert (free[near] == 1).all()
    np.testing.assert_allclose(free[between], 1 - 0.8 * np.exp(-1))
    np.testing.assert_allclose(free[far], 0.2)
    assert (free_of_met(Met(np.zeros(0), np.zeros(0)), constants) == 1).all()


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


def test_a_zone_without_a_range_is_predicted_by_its_neighbours_points():
    prediction = RangePrediction(RangeMemory(OPTICS, SHAPE), UNIT)
    range_m = wall(3.0)
    range_m[::2] = np.nan
    prediction.take(pose(), range_m, np.full(len(UNIT), 0.01))
    np.testing.assert_allclose(prediction.at(pose(0.1)), wall(3.0), rtol=0.01)


def ahead_of(sigma, depth_m=None, alone=0.2):
    rays = pixel_rays(OPTICS, SHAPE)
    depth_m = np.full(SHAPE, 3.0) if depth_m is None else depth_m
    prior = CorridorPrior(0.0, 0.5, 0.4, 0.0, 0.3)
    return Ahead(rays, depth_m, np.full(SHAPE, 0.1), None, prior, left=sigma / alone)


def test_the_spread_of_obstacles_shrinks_with_the_variance_left_in_the_corridor():
    whole, half = np.full(SHAPE, 0.2), np.full(SHAPE, 0.1)
    plain = replace(ahead_of(whole), left=None)
    np.testing.assert_array_equal(ahead_of(whole).free(), plain.free())
    surer = replace(plain, prior=replace(plain.prior, sigma=0.2))
    np.testing.assert_array_equal(ahead_of(half).free(), surer.free())
    beside = np.full(SHAPE, 0.2)
    beside[:, 0] = 0.001  # 0.9 m from the axis
    np.testing.assert_array_equal(ahead_of(beside).free(), plain.free())
    far = np.full(SHAPE, 39.0)  # no pixel in the corridor
    np.testing.assert_array_equal(
        ahead_of(half, far).free(), replace(ahead_of(whole, far), left=None).free()
    )


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


def test_distances_are_along_the_corridor_and_points_count_in_its_own():
    direction = np.array([0.3, -0.2, 1.0])
    unit = direction / np.linalg.norm(direction)
    points_m = LocalPoints(np.array([2.0 * unit, [0.0, 0.0, 2.0]]), np.zeros(2))
    np.testing.assert_allclose(met_in_corridor(points_m, unit).depth_m, [2.0])
    np.testing.assert_allclose(met_in_corridor(points_m).depth_m, [2.0])
    met = replace(ahead_of(np.full(SHAPE, 0.2), np.full(SHAPE, 39.0)), points=points_m)
    assert nearest_obstacle_m(met.free(direction), 0.5) == pytest.approx(2.0, rel=0.11)


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
        ahead_of(np.full(SHAPE, 0.2)).free(direction)
