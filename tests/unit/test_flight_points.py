"""Points that a flight remembers: where a later view sees them, and when they are forgotten."""

import numpy as np
import pytest

from flights import OPTICS, SHAPE, pose, ranges, towards
from reconstruction.depth.memory.points import MAX_POINTS, RangeMemory

SIGMA_M = 0.01


def memory():
    return RangeMemory(OPTICS, SHAPE)


def met(remembered, at, pixels, depth_m, sigma_m=SIGMA_M):
    """Add what spots at some pixels meet."""
    directions = towards(*pixels)
    range_m = ranges(directions, np.broadcast_to(depth_m, len(pixels)))
    remembered.add(at, directions, range_m, np.full(len(pixels), sigma_m))


def test_a_point_is_seen_where_it_is_from_another_pose():
    remembered = memory()
    met(remembered, pose(0), [(20, 40)], 5.0)
    column, row = 0.3 * (2 * np.array([40, 20]) + 1 - 64) / 64
    (point,) = remembered.points.position_m
    np.testing.assert_allclose(point, [5 * column, 5 * row, 5], atol=1e-12)
    # Half a metre to the right, one ahead, and turned by 0.1 about the vertical.
    turned = 0.1
    seen = remembered.seen(pose(30, (0.5, 0, 1), (0, turned, 0), 1e-4, 1e-6))
    x, y, z = 5 * column - 0.5, 5 * row, 4.0
    ahead, aside = z * np.cos(turned) + x * np.sin(turned), x * np.cos(turned) - z * np.sin(turned)
    expected = 32 * (1 + np.array([y, aside]) / ahead / 0.3) - 0.5
    np.testing.assert_allclose(seen.pixel, [expected], atol=1e-9)
    np.testing.assert_allclose(np.exp(seen.log_depth), [ahead])
    range_m = 5 * np.sqrt(1 + column**2 + row**2)
    common = 1 - np.exp(-30 / 117 / 0.3)
    apart = common * 1e-4 / ahead**2
    np.testing.assert_allclose(seen.log_variance, [(SIGMA_M / range_m) ** 2 + apart])
    pixels2 = (32 / 0.3) ** 2 * (apart + common * 1e-6)
    np.testing.assert_allclose(seen.pixel_variance, [pixels2])


def test_what_lies_behind_or_beside_the_view_is_not_seen():
    remembered = memory()
    met(remembered, pose(0), [(20, 40)], 5.0)
    assert not len(remembered.seen(pose(1, (0, 0, 6))).index)
    assert not len(remembered.seen(pose(1, turn_rad=(0, 0.7, 0))).index)
    assert len(remembered.points) == 1


def test_points_of_one_place_are_fused():
    remembered, rng = memory(), np.random.default_rng(0)
    direction = towards((30, 30))
    range_m = ranges(direction, [4.0])
    for number in range(50):
        measured = range_m + SIGMA_M / 2 * rng.standard_normal(1)
        remembered.add(pose(number), direction, measured, np.full(1, SIGMA_M))
    assert len(remembered.points) == 1
    np.testing.assert_allclose(
        remembered.points.log_variance, (SIGMA_M / range_m) ** 2 / 50, rtol=0.02
    )
    distance_m = np.linalg.norm(remembered.points.position_m)
    assert abs(distance_m - range_m[0]) < 3 * SIGMA_M / np.sqrt(50)


def test_other_depths_of_one_pixel_are_other_points():
    remembered = memory()
    met(remembered, pose(0), [(30, 30)], 4.0)
    met(remembered, pose(1), [(30, 30)], 3.9)  # nearer: nothing says that the other is gone
    assert len(remembered.points) == 2


@pytest.mark.parametrize(
    ("range_m", "sigma_m"), [(np.nan, 0.01), (4.0, np.nan), (0.05, 0.001), (4.0, 1.3)]
)
def test_ranges_that_say_nothing_make_no_point(range_m, sigma_m):
    remembered = memory()
    remembered.add(pose(0), towards((30, 30)), np.array([range_m]), np.array([sigma_m]))
    assert not len(remembered.points)


def test_a_point_behind_another_is_hidden():
    remembered = memory()
    met(remembered, pose(0), [(30, 30), (30, 50)], 8.0)
    met(remembered, pose(1), [(30, 31)], 3.0)
    seen = remembered.seen(pose(2))
    np.testing.assert_allclose(np.sort(np.exp(seen.log_depth)), [3, 8])
    np.testing.assert_allclose(seen.pixel[np.argmax(seen.log_depth)], [30, 50], atol=1e-9)
    assert len(remembered.seen(pose(2), hidden=True).index) == 3
    assert remembered.seen(pose(2), hidden=True).log_depth == pytest.approx(np.log([8, 8, 3]))


def test_a_spot_that_passes_through_drops_a_point_and_its_neighbours():
    remembered = memory()
    on_it, beside, deeper = (30, 30), (33, 34), (28, 33)
    met(remembered, pose(0), [on_it, beside, (30, 55), (10, 30)], 3.0)
    met(remembered, pose(1), [deeper], 5.0)
    met(remembered, pose(2), [on_it], 8.0)
    seen = remembered.seen(pose(3), hidden=True)
    left = {tuple(pixel) for pixel in np.round(seen.pixel).astype(int).tolist()}
    assert left == {on_it, (30, 55), (10, 30), deeper}
    assert np.exp(seen.log_depth).max() == pytest.approx(8)
    assert np.sum(np.abs(np.exp(seen.log_depth) - 3) < 0.01) == 2


def test_a_range_with_a_large_error_drops_nothing():
    remembered = memory()
    met(remembered, pose(0), [(30, 30)], 3.0)
    met(remembered, pose(1), [(30, 30)], 5.0, sigma_m=1.0)
    assert 3.0 in np.round(np.exp(remembered.seen(pose(2), hidden=True).log_depth), 3)


def test_an_object_that_flies_away_leaves_no_points_behind():
    remembered = memory()
    columns = np.arange(20, 44, 3)
    for number in range(70):  # 0.3 s of it, then 0.3 s without
        away = number >= 35
        column = columns[number % len(columns)]
        met(remembered, pose(number), [(30, column), (36, column)], 8.0 if away else 3.0)
    np.testing.assert_allclose(np.linalg.norm(remembered.points.position_m, axis=1) > 7, True)
    assert len(remembered.points) >= len(columns)


def test_there_are_never_more_points_than_fit_and_the_oldest_go_first():
    remembered, rng = memory(), np.random.default_rng(1)
    for number in range(300):
        pixels = rng.integers(0, 64, (4, 2)).tolist()
        met(remembered, pose(number, (0.3 * number, 0, 0)), pixels, rng.uniform(3, 9, 4))
        assert len(remembered.points) <= MAX_POINTS
    assert len(remembered.points) == MAX_POINTS
    times = remembered.points.time_s
    assert (np.diff(times) >= 0).all()
    assert times[0] > pose(300 - MAX_POINTS // 4 - 10).time_s


def test_what_a_range_meets_hides_the_points_close_behind_it():
    """Hidden ones too, but none nearer, or farther away in the image."""
    remembered = memory()
    met(remembered, pose(0), [(30, 30), (30, 33), (30, 36), (50, 50)], [8.0, 8.0, 8.0, 3.0])
    met(remembered, pose(1), [(31, 30)], 6.0)
    none = np.zeros((0, 3))
    remembered.forget_behind(pose(2), none, none[:, 0])
    assert len(remembered.points) == 5
    directions = towards((30, 30), (50, 51))
    remembered.forget_behind(pose(2), directions, ranges(directions, [5.5, 5.0]))
    seen = remembered.seen(pose(2), hidden=True)
    np.testing.assert_allclose(np.exp(seen.log_depth), [8, 3, 6])
    np.testing.assert_allclose(seen.pixel, [[30, 36], [50, 50], [31, 30]], atol=1e-9)
