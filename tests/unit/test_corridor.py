"""Probability that the corridor ahead is free: closed forms, bounds, and where obstacles are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from reconstruction import Reconstructor
from reconstruction.base.errors import InputError
from reconstruction.capture import Optics
from reconstruction.depth import DISTANCES_M, MAX_RANGE_M, Corridor, nearest_obstacle_m, pixel_rays
from reconstruction.depth.obstacle import NEAREST_M, CorridorPrior, corridor_prior, free_of

SHAPE = (32, 32)
CORRIDOR = Corridor(pixel_rays(Optics(0.18, 0.18), SHAPE))
PLAIN = CorridorPrior(bias=0.0, scale=1.0, sigma=0.1, outlier=0.0, map_sigma=0.2)
WALL = np.full(SHAPE, 5.0)


@pytest.mark.parametrize("sigma", [0.05, 0.2, 0.4])
def test_a_wall_is_as_near_as_its_normal_error_of_ln_depth(sigma):
    free = CORRIDOR.free(WALL, PLAIN, np.full(SHAPE, sigma))
    combined = np.hypot(sigma, PLAIN.sigma)
    expected = 1 - ndtr(np.log(DISTANCES_M / 5.0) / combined)
    # Eleven quantiles lack tails; half of the last of them is 1 / 22.
    np.testing.assert_allclose(free, expected, atol=1 / 22)


def test_the_sigma_of_maps_without_any_is_that_of_the_prior():
    stated = CORRIDOR.free(WALL, PLAIN, np.full(SHAPE, PLAIN.map_sigma))
    np.testing.assert_array_equal(CORRIDOR.free(WALL, PLAIN), stated)


def test_corridors_of_a_batch_are_free_as_each_is():
    ensembles = np.random.default_rng(4).uniform(1.0, 8.0, (2, 3, 11))
    batch = free_of(ensembles, PLAIN)
    assert batch.shape == (2, 3, len(DISTANCES_M))
    for index in np.ndindex(2, 3):
        np.testing.assert_allclose(batch[index], free_of(ensembles[index], PLAIN))


def test_a_bias_moves_obstacles():
    free = CORRIDOR.free(WALL, replace(PLAIN, bias=np.log(1.2)), np.full(SHAPE, 0.1))
    assert nearest_obstacle_m(free, 0.5) == pytest.approx(6.0, rel=0.01)


@pytest.mark.parametrize("no_return", [0.0, 1 / 3, 0.5, 1.0])
def test_where_nothing_is_as_likely_everywhere_so_is_a_free_corridor(no_return):
    free = CORRIDOR.free(WALL, PLAIN, np.full(SHAPE, 0.1), np.full(SHAPE, no_return))
    assert free[-1] == pytest.approx(no_return, abs=1e-6)


def test_a_map_that_tells_nothing_leaves_the_obstacle_anywhere():
    free = CORRIDOR.free(WALL, replace(PLAIN, outlier=1.0))
    expected = 1 - np.log(DISTANCES_M / NEAREST_M) / np.log(MAX_RANGE_M / NEAREST_M)
    np.testing.assert_allclose(free, np.clip(expected, 0, 1), atol=1e-12)


@pytest.mark.parametrize("prior", ["learned", "others"])
@pytest.mark.parametrize("seed", range(5))
def test_probabilities_never_rise_with_distance(prior, seed):
    rng = np.random.default_rng(seed)
    depth_m = np.exp(rng.normal(1.5, 0.8, SHAPE))
    depth_m[rng.random(SHAPE) < 0.2] = np.nan
    sigma, no_return = rng.uniform(0.02, 1, SHAPE), rng.random(SHAPE)
    free = CORRIDOR.free(depth_m, corridor_prior(prior), sigma, no_return)
    assert free.shape == DISTANCES_M.shape
    assert ((free >= 0) & (free <= 1)).all()
    assert (np.diff(free) <= 1e-12).all()


def test_obstacles_are_where_the_probability_falls_below_what_is_asked():
    free = CORRIDOR.free(WALL, PLAIN, np.full(SHAPE, 0.2))
    reported = [nearest_obstacle_m(free, each) for each in (0.95, 0.9, 0.7, 0.5, 0.1)]
    assert reported == sorted(reported)
    for min_free, distance_m in zip((0.9, 0.7), reported[1:], strict=False):
        interpolated = np.interp(np.log(distance_m), np.log(DISTANCES_M), free)
        assert interpolated == pytest.approx(min_free)
    assert np.isnan(nearest_obstacle_m(np.ones(DISTANCES_M.size), 0.5))
    assert nearest_obstacle_m(np.zeros(DISTANCES_M.size)) == DISTANCES_M[0]


@pytest.mark.parametrize("min_free", [0.0, 1.0, -1, 1.5, np.nan])
def test_what_is_no_probability_is_refused(min_free, capture):
    with pytest.raises(InputError, match=r"min_free = .*must lie between 0 and 1"):
        nearest_obstacle_m(np.ones(DISTANCES_M.size), min_free)
    with pytest.raises(InputError, match="min_free"):
        Reconstructor(capture.setup, min_free=min_free)


def test_the_probability_that_is_asked_for_sets_the_obstacle(capture):
    near, far = (
        Reconstructor(capture.setup, image="zero-filled", min_free=each)(capture.frame(0))
        for each in (0.95, 0.3)
    )
    np.testing.assert_array_equal(near.free_probability, far.free_probability)
    assert near.obstacle_m < far.obstacle_m
    assert replace(near, min_free=0.3).obstacle_m == far.obstacle_m


@pytest.mark.parametrize("depth", ["learned", "anchored", "nearest"])
def test_results_state_corridors_in_other_directions(depth, capture):
    result = Reconstructor(capture.setup, image="zero-filled", depth=depth)(capture.frame(0))
    np.testing.assert_array_equal(result.free_towards((0, 0, 2)), result.free_probability)
    beside = result.free_towards((0.02, -0.01, 1))
    assert beside.shape == DISTANCES_M.shape
    assert (np.diff(beside) <= 1e-12).all()


def test_a_result_without_corridors_says_so(capture):
    result = Reconstructor(capture.setup, image="zero-filled")(capture.frame(0))
    with pytest.raises(InputError, match="no corridors: it has no depths, or is from a file"):
        replace(result, corridors={}).free_towards((0, 0, 1))
