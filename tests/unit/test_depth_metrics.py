"""Metrics of depth maps: known values, honest deviations, skies, obstacles and free space."""

import numpy as np
import pytest

from reconstruction.capture import Optics
from reconstruction.depth import MAX_RANGE_M, pixel_rays
from reconstruction.depth.obstacle import CORRIDOR_M, DISTANCES_M, OBSTACLE_M2, Corridor
from reconstruction.evaluation import depth_metrics

SHAPE = (64, 64)
TAN = np.tan(np.radians(10))
RAYS = pixel_rays(Optics(TAN, TAN), SHAPE)
ROWS, COLUMNS = np.mgrid[:64, :64]
WALL = np.full(SHAPE, 8.0)
SKY = np.full(SHAPE, np.nan)


def with_box(depth_m, side, row=32, column=32, behind=WALL):
    """A square of so many pixels before a wall."""
    inside = (abs(ROWS + 0.5 - row) < side / 2) & (abs(COLUMNS + 0.5 - column) < side / 2)
    return np.where(inside, depth_m, behind)


def of(depth_m, true_m, **given):
    return depth_metrics(depth_m, true_m, rays=RAYS, **given)


def test_relative_errors_are_those_of_the_literature():
    metrics = depth_metrics(np.array([1.1, 1.6, 6.0]), np.array([1.0, 2.0, 5.0]))
    assert metrics["abs_rel"] == pytest.approx((0.1 + 0.2 + 0.2) / 3)
    # 2 / 1.6 is 1.25, though the error is 20 % of the truth
    assert metrics["delta_1_25"] == pytest.approx(2 / 3)
    assert metrics["within_25_percent"] == 1


def test_honest_deviations_hold_their_shares():
    rng = np.random.default_rng(1)
    sigma = rng.uniform(0.05, 0.4, (100, 100))
    result = depth_metrics(5 * np.exp(sigma * rng.normal(size=sigma.shape)), 5 + 0 * sigma,
                          sigma=sigma)  # fmt: skip
    for sigmas, fraction in ((1, 0.6827), (2, 0.9545)):
        z = (result[f"within_{sigmas}_sigma"] - fraction) / np.sqrt(
            fraction * (1 - fraction) / sigma.size
        )
        assert abs(z) < 4
    proud = depth_metrics(5 * np.exp(sigma), 5 + 0 * sigma, sigma=sigma / 3)
    assert proud["within_1_sigma"] == proud["within_2_sigma"] == 0
    assert depth_metrics(WALL, WALL)["within_1_sigma"] is None


def test_what_is_beyond_reach_counts_as_nothing():
    true_m = np.array([5.0, MAX_RANGE_M + 1, 3000.0, np.nan])
    result = depth_metrics(np.array([5.0, 20.0, np.nan, MAX_RANGE_M + 9]), true_m)
    assert result["coverage"] == result["within_25_percent"] == 1
    assert result["mae_m"] == 0
    assert result["nothing_share"] == 0.75
    assert result["invented"] == pytest.approx(1 / 3)  # what is told farther than that is nothing
    assert depth_metrics(WALL, WALL)["invented"] is None
    farthest, nothing = np.full(SHAPE, MAX_RANGE_M), np.full(SHAPE, np.nan)
    assert depth_metrics(farthest, nothing)["invented"] == 1.0


def test_the_brier_score_of_the_base_rate_is_its_variance():
    true_m = np.where(COLUMNS < 16, np.nan, WALL)
    fraction = 0.25
    score = of(WALL, true_m, no_return=np.full(SHAPE, fraction))["nothing_brier"]
    assert score == pytest.approx(fraction * (1 - fraction))
    assert of(WALL, true_m, no_return=np.isnan(true_m).astype(float))["nothing_brier"] == 0
    assert of(WALL, true_m, no_return=(~np.isnan(true_m)).astype(float))["nothing_brier"] == 1
    assert of(WALL, true_m)["nothing_brier"] is None


@pytest.mark.parametrize(
    ("reported", "true", "missed", "false"),
    [
        (4.0, 4.0, 0, 0),
        (4.9, 4.0, 0, 0),
        (5.2, 4.0, 1, 0),
        (8.0, 4.0, 1, 0),
        (3.1, 4.0, 0, 0),
        (2.9, 4.0, 0, 1),
    ],
)
def test_obstacles_ahead_are_missed_or_seen_where_there_are_none(reported, true, missed, false):
    result = of(with_box(reported, 12), with_box(true, 12))
    assert result["obstacle_error"] == pytest.approx(reported / true - 1)
    assert (result["obstacle_missed"], result["obstacle_false"]) == (missed, false)


def test_without_an_obstacle_one_is_neither_missed_nor_off():
    seen = of(with_box(4.0, 12, behind=SKY), SKY)
    assert seen["obstacle_missed"] is seen["obstacle_error"] is None
    assert seen["obstacle_false"] == 1
    no_return_reported = of(SKY, with_box(4.0, 12, behind=SKY))
    assert (no_return_reported["obstacle_missed"], no_return_reported["obstacle_false"]) == (1, 0)
    assert no_return_reported["obstacle_error"] is None
    assert of(SKY, SKY)["obstacle_false"] == 0


def test_only_what_is_in_the_corridor_is_an_obstacle():
    wide = 2 * TAN * 4 / 64  # of a pixel at 4 m
    for column in range(64):
        box = with_box(4.0, 8, column=column, behind=SKY)
        at_m = abs(column - 32) * wide
        if at_m < CORRIDOR_M / 2 - 2 * wide:
            assert Corridor(RAYS).nearest_m(box) == 4
        if at_m > CORRIDOR_M / 2 + 6 * wide:
            assert np.isnan(Corridor(RAYS).nearest_m(box))


@pytest.mark.parametrize("depth_m", [1.0, 4.0, 12.0])
@pytest.mark.parametrize("pixels", [32, 64, 256])
def test_an_obstacle_has_a_size_whatever_the_pixels(depth_m, pixels):
    rays = pixel_rays(Optics(TAN, TAN), (pixels, pixels))
    pixel_m2 = (2 * TAN * depth_m / pixels) ** 2
    minimum = int(np.ceil(OBSTACLE_M2 / pixel_m2 - 1e-9))
    inside = np.abs(rays[..., :2]).max(axis=-1) * depth_m <= CORRIDOR_M / 2
    order = np.flatnonzero(inside)
    for count, seen in ((minimum, True), (minimum - 1, False)):
        depth = np.full(pixels**2, np.nan)
        depth[order[:count]] = depth_m
        result = Corridor(rays).nearest_m(depth.reshape(pixels, pixels))
        assert (result == depth_m) if seen else np.isnan(result)


def test_free_space_is_told_up_to_the_surface():
    near = of(WALL / 2, WALL)
    assert (near["free_precision"], near["free_recall"]) == (1, 0.5)
    far = of(2 * WALL, WALL)
    assert (far["free_precision"], far["free_recall"]) == (0.5, 1)
    unknown = of(SKY, WALL)
    assert unknown["free_precision"] is None
    assert unknown["free_recall"] == 0


def test_where_nothing_is_told_all_is_free_within_reach():
    sky = of(SKY, SKY, no_return=np.ones(SHAPE))
    assert (sky["free_precision"], sky["free_recall"]) == (1, 1)
    wrong = of(SKY, WALL, no_return=np.ones(SHAPE))
    assert wrong["free_precision"] == pytest.approx(8 / MAX_RANGE_M)
    assert of(SKY, SKY, no_return=np.zeros(SHAPE))["free_recall"] == 0


def test_a_map_of_one_row_has_its_obstacles():
    rays = pixel_rays(Optics(TAN, TAN), (1, 64))
    assert Corridor(rays).nearest_m(np.full((1, 64), 5.0)) == 5.0


def test_an_obstacle_is_where_the_stated_probability_says():
    box, free = with_box(4.0, 12), np.where(DISTANCES_M < 3.9, 0.95, 0.1)
    seen = of(with_box(5.2, 12), box, free=free)
    assert seen["obstacle_error"] == pytest.approx(-0.05, abs=0.1)
    assert (seen["obstacle_missed"], seen["obstacle_false"]) == (0, 0)
    assert of(box, box, free=free, min_free=0.99)["obstacle_false"] == 1
    assert of(box, box, free=np.ones_like(free))["obstacle_missed"] == 1


def test_probabilities_of_a_free_corridor_are_scored():
    box, truly = with_box(4.0, 12), (DISTANCES_M < 4.0).astype(float)
    right = of(box, box, free=truly)
    assert (right["free_brier"], right["free_bias"]) == (0, 0)
    none = of(box, box, free=np.ones_like(truly))
    assert none["free_brier"] == none["free_bias"] == pytest.approx(1 - truly.mean())
    unsure = of(box, box, free=np.full_like(truly, 0.5))
    assert unsure["free_brier"] == 0.25
    assert of(box, box)["free_brier"] is None
