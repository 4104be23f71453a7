"""Memory of a flight: maps carried on, and corrections."""

from dataclasses import replace

import numpy as np
import pytest

from flights import OPTICS, SHAPE, pose, ranges, towards
from reconstruction.depth import DepthEstimate, pixel_rays
from reconstruction.depth.completion import Seen
from reconstruction.depth.completion.correction import (
    COARSE_ROWS,
    MAX_ANCHORS,
    MIN_REMAINING,
    STEPS,
    MapCorrector,
    by_distance,
    fitted_kernel,
    spread_out,
)
from reconstruction.depth.memory import FlightMemory, FrameRanges
from reconstruction.depth.memory.appearance import Appearance
from reconstruction.depth.memory.maps import MAX_SIGMAS, NEW, MapMemory, sampled

KERNEL = fitted_kernel()
SEEN = Appearance(np.ones(SHAPE), 0.0)
WHOLE = KERNEL.sharp + KERNEL.smooth + KERNEL.nugget


def test_a_still_camera_averages_noise_down():
    maps, rng, true = MapMemory(OPTICS, SHAPE), np.random.default_rng(0), np.log(5.0)
    sigma = np.full(SHAPE, 0.1)
    for number in range(120):
        result = maps.take(pose(number), true + 0.02 * rng.standard_normal(SHAPE), sigma, SEEN)
    expected = 0.02 * np.sqrt(NEW / (2 - NEW))
    assert result.std() == pytest.approx(expected, rel=0.15)
    assert abs(result.mean() - true) < expected / 10


@pytest.mark.parametrize(
    ("position_m", "turn_rad", "after_m"),
    [((0, 0, 1), (0, 0, 0), 4.0), ((0.4, 0, 0), (0, 0, 0), 5.0), ((0, 0, -1), (0, 0, 0.3), 6.0)],
)
def test_a_plane_is_carried_exactly(position_m, turn_rad, after_m):
    maps, sigma, off = MapMemory(OPTICS, SHAPE), np.full(SHAPE, 0.1), 0.05
    maps.take(pose(0), np.full(SHAPE, np.log(5) + off), sigma, SEEN)
    after = pose(1, position_m, turn_rad)
    result = maps.take(after, np.full(SHAPE, np.log(after_m)), sigma, SEEN)
    seen_m = (pixel_rays(OPTICS, SHAPE) * after_m) @ after.axes.T + after.position_m
    edge = 0.3 * 5 * (1 + 1e-9)
    before = (np.abs(seen_m[..., :2]) <= edge).all(axis=-1)
    assert 0.3 < before.mean() <= 1
    np.testing.assert_allclose(result[before], np.log(after_m) + (1 - NEW) * off, atol=1e-12)
    np.testing.assert_allclose(result[~before], np.log(after_m), atol=1e-12)


def test_where_the_scene_jumps_the_average_begins_anew():
    maps, sigma = MapMemory(OPTICS, SHAPE), np.full(SHAPE, 0.1)
    maps.take(pose(0), np.full(SHAPE, np.log(5)), sigma, SEEN)
    new = np.full(SHAPE, np.log(5) + 0.9 * MAX_SIGMAS * 0.1)
    new[:, 30:] = np.log(2)
    result = maps.take(pose(1), new, sigma, SEEN)
    np.testing.assert_allclose(result[:, 30:], np.log(2))
    np.testing.assert_allclose(result[:, :30], np.log(5) + NEW * 0.9 * MAX_SIGMAS * 0.1)


def test_values_between_pixels_are_bilinear_and_those_beyond_the_edge_of_the_edge():
    image = np.arange(12.0).reshape(3, 4) ** 2
    result = sampled(image, np.array([[0.5, 1.25], [-3, 2], [2, 9], [2, 3]]))
    top, bottom = 0.75 * 1 + 0.25 * 4, 0.75 * 25 + 0.25 * 36
    np.testing.assert_allclose(result, [(top + bottom) / 2, 4, 121, 121])


def seen(pixels, log_depth, log_variance=1e-8):
    """Points as a view sees them."""
    count = len(pixels)
    full = (np.full(count, each) for each in (log_variance, 0.0))
    return Seen(
        np.arange(count),
        np.array(pixels, float),
        np.broadcast_to(np.asarray(log_depth, float), count).copy(),
        *full,
    )


def correction(log_depth, sigma, points, kernel=None):
    """Correction of a map by a corrector of its own."""
    return MapCorrector(log_depth.shape, kernel)(log_depth, sigma, points)


def test_an_exact_point_corrects_the_map_there_and_not_across_an_edge():
    log_depth, sigma = np.full(SHAPE, np.log(4)), np.full(SHAPE, 0.2)
    log_depth[:, 36:] = np.log(16)
    gaussian = replace(KERNEL, freedom=1e9)
    result = correction(log_depth, sigma, seen([(30, 32)], np.log(4) + 0.1), gaussian)
    kept = KERNEL.sharp + KERNEL.smooth
    assert result.error[30, 32] == pytest.approx(0.1 * kept / WHOLE, rel=1e-4)
    assert result.remaining[30, 32] == pytest.approx(1 - kept**2 / WHOLE**2, rel=1e-4)
    four = KERNEL.sharp * np.exp(-4 / KERNEL.sharp_px)
    four += KERNEL.smooth * np.exp(-4 / KERNEL.smooth_px)
    across = np.exp(-(np.log(4) ** 2) / 2 / KERNEL.edge**2)
    assert across < 0.01
    assert result.error[30, 28] == pytest.approx(0.1 * four / WHOLE, rel=1e-4)
    assert result.error[30, 36] == pytest.approx(0.1 * four * across / WHOLE, rel=1e-4)
    assert result.remaining[30, 36] > 0.9999


@pytest.mark.parametrize("shape", [(64, 64), (63, 40), (128, 96), (16, 16)])
def test_the_variance_that_is_left_is_that_of_the_process(shape):
    log_depth, sigma = np.full(shape, np.log(4)), np.full(shape, 0.2)
    stride = max(shape[0] // COARSE_ROWS, 1)
    pixel = np.array([[4 * stride, 2 * stride], [8 * stride, 6 * stride]])
    left = correction(log_depth, sigma, seen(pixel, np.log(4))).remaining
    row, column = stride * np.array([6, 3])
    near = 64 / shape[0] * np.hypot(*(pixel - [row, column]).T)
    between = 64 / shape[0] * np.hypot(*(pixel[0] - pixel[1]))

    def like(apart):
        return by_distance(np.asarray(apart), KERNEL)

    weight = (KERNEL.freedom + 1) / KERNEL.freedom  # of points that agree
    own = like(0) + (KERNEL.nugget + 1e-8 / 0.2**2) / weight
    covariance = np.array([[own, like(between)], [like(between), own]])
    explained = like(near) @ np.linalg.solve(covariance, like(near))
    assert left[row, column] == pytest.approx(1 - explained / WHOLE, rel=1e-3)
    if stride > 1:
        assert left[row, column + stride // 2] == pytest.approx(
            (left[row, column] + left[row, column + stride]) / 2
        )


@pytest.mark.parametrize("shape", [(64, 64), (63, 40), (128, 96), (8, 8)])
def test_many_points_are_solved_as_by_the_whole_matrix(shape):
    rng, count, unit = np.random.default_rng(5), 150, 64 / shape[0]
    log_depth = np.log(4) + 0.3 * rng.standard_normal(shape).cumsum(axis=1) / shape[1] ** 0.5
    sigma, side = rng.uniform(0.1, 0.3, shape), np.array(shape) - 1
    steps = round(STEPS * unit)
    pixel = np.round(steps * rng.uniform(0, side, (count, 2))) / steps
    points = seen(pixel, np.log(4) + 0.1 * rng.standard_normal(count), log_variance=1e-3)
    row, column = np.round(pixel).astype(int).T
    mean, spread = log_depth[row, column], sigma[row, column]
    rows, columns = np.mgrid[: shape[0], : shape[1]].reshape(2, -1)

    def covariance(down, along, depth):
        apart = unit * np.hypot(down[:, None] - pixel[:, 0], along[:, None] - pixel[:, 1])
        contrast = (depth[:, None] - mean) / KERNEL.edge
        return by_distance(apart, KERNEL) * np.exp(-(contrast**2) / 2)

    noise = KERNEL.nugget + 1e-3 / spread**2
    whole = covariance(*pixel.T, mean) + np.diag(noise)
    to_pixels = covariance(rows, columns, log_depth.ravel())
    weight = (points.log_depth - mean) / spread
    result = correction(log_depth, sigma, points, replace(KERNEL, freedom=1e9))
    error = (to_pixels @ np.linalg.solve(whole, weight)).reshape(shape) * sigma
    np.testing.assert_allclose(result.error, error, atol=3e-4)
    left = 1 - (to_pixels * np.linalg.solve(whole, to_pixels.T).T).sum(axis=1) / WHOLE
    some = (slice(None, None, max(shape[0] // COARSE_ROWS, 1)),) * 2
    left = np.maximum(left.reshape(shape)[some], MIN_REMAINING)
    np.testing.assert_allclose(result.remaining[some], left, atol=2e-3)


def test_a_corrector_keeps_nothing_of_the_map_before():
    corrector, rng = MapCorrector(SHAPE), np.random.default_rng(4)
    log_depth, sigma = np.full(SHAPE, np.log(5)), np.full(SHAPE, 0.2)
    corrector(log_depth, sigma, seen(rng.uniform(0, 63, (50, 2)), np.log(7)))
    points = seen([(20, 20), (40, 30)], np.log(4))
    again, alone = corrector(log_depth, sigma, points), correction(log_depth, sigma, points)
    np.testing.assert_array_equal(again.error, alone.error)
    np.testing.assert_array_equal(again.remaining, alone.remaining)


def test_the_unit_of_length_is_a_pixel_of_64_rows():
    small = correction(np.zeros(SHAPE), np.full(SHAPE, 0.2), seen([(31.5, 31.5)], 0.1))
    large = correction(np.zeros((128, 128)), np.full((128, 128), 0.2), seen([(63.5, 63.5)], 0.1))
    means = large.error.reshape(64, 2, 64, 2).mean(axis=(1, 3))
    # But for the middle, where the covariance has a peak.
    near = np.hypot(*(np.mgrid[:64, :64] - 31.5)) < 4
    np.testing.assert_allclose(means[~near], small.error[~near], rtol=0.01)


@pytest.mark.parametrize("log_variance", [1e-4, 1e-2])
def test_an_outlier_among_points_that_agree_has_less_weight(log_variance):
    log_depth, sigma = np.full(SHAPE, np.log(5)), np.full(SHAPE, 0.2)
    pixels = [(row, column) for row in (28, 32, 36) for column in (28, 32, 36)]
    stated = np.full(9, np.log(5))
    stated[4] += 1.5
    points = seen(pixels, stated, log_variance=log_variance)
    robust = correction(log_depth, sigma, points).error[32, 32]
    gaussian = correction(log_depth, sigma, points, replace(KERNEL, freedom=1e9)).error[32, 32]
    assert gaussian > 0.3
    assert 0 <= robust < 0.6 * gaussian
    agreed = correction(log_depth, sigma, replace(points, log_depth=np.full(9, np.log(5) + 0.2)))
    assert agreed.error[32, 32] == pytest.approx(0.2, rel=0.15)


def test_without_points_there_is_no_correction():
    assert correction(np.zeros(SHAPE), np.full(SHAPE, 0.2), seen([], 0.0)) is None


def test_of_many_points_the_surest_of_each_cell_are_used():
    rng = np.random.default_rng(2)
    points = seen(rng.uniform(0, 63, (1500, 2)), 0.0)
    points = replace(points, log_variance=rng.uniform(0, 1, 1500))
    result = spread_out(points, SHAPE)
    assert MAX_ANCHORS / 2 < len(result.index) <= MAX_ANCHORS
    for low in ((0, 0), (0, 32), (32, 0), (32, 32)):
        inside = ((result.pixel >= low) & (result.pixel < np.add(low, 32))).all(axis=1)
        assert inside.sum() > 10
    assert result.log_variance.mean() < 0.5 * points.log_variance.mean()
    few = points[np.arange(MAX_ANCHORS)]
    assert spread_out(few, SHAPE) is few


SPOTS = towards((16, 16), (16, 48), (48, 16), (48, 48))
IMAGE = np.ones(SHAPE)


def estimate(depth_m, sigma=0.15):
    """Map of a frame alone."""
    return DepthEstimate(np.full(SHAPE, depth_m), np.full(SHAPE, sigma), np.full(SHAPE, 0.1))


def measured(depth_m, sigma_m=0.01):
    """Ranges of four spots on a plane."""
    return FrameRanges(SPOTS, ranges(SPOTS, depth_m), np.full(4, sigma_m))


@pytest.mark.parametrize(
    ("no_return", "off", "left"),
    [(None, 0.02, 0.6), (np.full(SHAPE, 0.1), 0.03, 0.7)],
    ids=["by the points alone", "and by the network"],
)
def test_what_spots_met_corrects_the_map_where_they_now_point_elsewhere(no_return, off, left):
    memory, given = FlightMemory(OPTICS, SHAPE), replace(estimate(6.0), no_return=no_return)
    memory.take(pose(0), IMAGE, given, measured(5.0))
    nowhere = FrameRanges(SPOTS, np.full(4, np.nan), np.full(4, np.nan))
    result, points_m, log_sigma, why, _ = memory.take(pose(1, (0.2, 0, 0)), IMAGE, given, nowhere)
    assert why is None
    column = 16 - round(0.2 / 5 / 0.3 * 32)
    assert result.depth_m[16, column] == pytest.approx(5.0, rel=off)
    assert result.sigma[16, column] < left * 0.15
    assert no_return is None or result.no_return[16, column] < 0.06
    assert 5.5 < result.depth_m[0, 32] < 6.01
    assert points_m[:, 2] == pytest.approx([5] * 4)
    seen = np.isfinite(log_sigma)
    assert seen.any()
    assert log_sigma[seen] == pytest.approx(0.01 / 5, rel=0.5)


def test_a_jump_of_the_pose_is_named_and_all_is_forgotten():
    memory = FlightMemory(OPTICS, SHAPE)
    memory.take(pose(0), IMAGE, estimate(6.0), measured(5.0))
    result, _, _, why, _ = memory.take(pose(1, (0, 0, 20)), IMAGE, estimate(6.0), measured(5.0))
    assert why == "the position jumps by 20 m in 0.00855 s"
    assert len(memory.ranges.points) == 4
    fresh = FlightMemory(OPTICS, SHAPE)
    alone, *_ = fresh.take(pose(1, (0, 0, 20)), IMAGE, estimate(6.0), measured(5.0))
    np.testing.assert_array_equal(result.depth_m, alone.depth_m)


def test_poses_are_those_that_the_clock_corrects():
    memory, begun = FlightMemory(OPTICS, SHAPE), []
    memory.clock.begin = lambda: begun.append(True)
    memory.clock.offset_s = 0.1
    memory.clock.corrected = lambda: pose(0, (0, 0, 1))
    result = memory.take(pose(0), IMAGE, estimate(6.0), measured(5.0))
    assert result.late_s == 0.1
    assert memory.ranges.points.position_m[:, 2] == pytest.approx([6] * 4)
    assert result.points_m[:, 2] == pytest.approx([5] * 4)
    assert not begun
    memory.take(pose(1, (0, 0, 20)), IMAGE, estimate(6.0), measured(5.0))
    assert begun


def test_maps_without_sigma_or_depth_are_left_as_they_are_and_ranges_kept():
    memory = FlightMemory(OPTICS, SHAPE)
    for given in (
        replace(estimate(6.0), sigma=None),
        replace(estimate(6.0), depth_m=np.full(SHAPE, np.nan)),
    ):
        result, *_ = memory.take(pose(1), IMAGE, given, measured(5.0))
        assert result is given
        assert len(memory.ranges.points) == 4
        memory = FlightMemory(OPTICS, SHAPE)


def test_a_drone_that_stands_still_neither_fills_its_memory_nor_drifts():
    memory, rng = FlightMemory(OPTICS, SHAPE), np.random.default_rng(3)
    biased = estimate(5.5)
    counts, middles = [], []
    for number in range(3000):
        here = pose(number, 0.01 * rng.standard_normal(3), variance_m2=1e-4, variance_rad2=1e-6)
        given = measured(5.0)
        noisy = replace(given, range_m=given.range_m + 0.01 * rng.standard_normal(4))
        memory.ranges.add(here, noisy.directions, noisy.range_m, noisy.sigma_m)
        if number % 100 == 99:
            result, *_ = memory.take(here, IMAGE, biased, noisy)
            counts.append(len(memory.ranges.points))
            middles.append(result.depth_m[16, 16])
    assert max(counts[10:]) <= 1.5 * np.median(counts[10:])
    assert max(counts) < 100
    np.testing.assert_allclose(middles, 5.0, rtol=0.03)
