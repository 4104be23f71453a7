"""What the network of depth completion sees, and what it makes of it."""

import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest

from flights import OPTICS, SHAPE
from reconstruction.depth import DepthEstimate, pixel_rays
from reconstruction.depth.completion import MapCompletion, Seen
from reconstruction.depth.completion.correction import MapCorrector, fitted
from reconstruction.depth.completion.network import (
    FEW,
    MAPS,
    MIN_SIGMA,
    SCALES_PX,
    SURE,
    WEIGHTS,
    brightness_of,
    completion_input,
)

STATED_M, TRUE_M, SIGMA = 4.0, 5.0, 0.2
LIT = np.random.default_rng(3).uniform(0.5, 1, SHAPE)


def stated(shape=SHAPE):
    """Map of a wall that is too near."""
    return DepthEstimate(np.full(shape, STATED_M), np.full(shape, SIGMA), np.full(shape, 0.05))


def points(count, shape=SHAPE, sigma=0.01, pixel_variance=0.5):
    """Points of the true wall, one of which is far off."""
    rng = np.random.default_rng(1)
    known, variance = np.full(count, np.log(TRUE_M)), np.full(count, sigma**2)
    known[0] += 0.5
    pixel = rng.uniform(0, np.array(shape) - 1, (count, 2))
    return Seen(np.arange(count), pixel, known, variance, np.full(count, pixel_variance))


@pytest.fixture(scope="module")
def inputs():
    correction = MapCorrector(SHAPE)(np.log(stated().depth_m), stated().sigma, points(40))
    rays = pixel_rays(OPTICS, SHAPE)
    return correction, completion_input(brightness_of(LIT), rays, stated(), correction)


def test_the_network_sees_the_corrected_map_its_correction_and_what_is_left(inputs):
    correction, (maps, log_depth, sigma) = inputs
    assert maps.shape == (MAPS, *SHAPE)
    assert maps.dtype == np.float32
    np.testing.assert_allclose(log_depth, np.log(STATED_M) + correction.error)
    np.testing.assert_allclose(sigma, np.maximum(SIGMA * np.sqrt(correction.remaining), MIN_SIGMA))
    np.testing.assert_allclose(maps[0], log_depth - log_depth.mean(), atol=1e-5)
    np.testing.assert_allclose(maps[1], correction.error, atol=1e-6)
    np.testing.assert_allclose(maps[3], np.log(sigma), rtol=1e-5)
    np.testing.assert_allclose(maps[4], np.log(LIT / np.percentile(LIT, 90)), atol=1e-6)


@pytest.mark.parametrize("pixel", [(0, 0), (20, 41), (63, 30)])
def test_neighbourhoods_are_sums_over_the_points(inputs, pixel):
    correction, (maps, log_depth, _) = inputs
    seen, here = correction.points, log_depth[pixel]
    apart2 = ((seen.pixel - pixel) ** 2).sum(axis=1)
    weight = SURE**2 / (SURE**2 + seen.log_variance)
    near, wide = (weight * np.exp(-apart2 / (2 * scale**2)) for scale in SCALES_PX)
    of = maps[(slice(8, None), *pixel)]
    off = np.clip(correction.contradiction, -1, 1)
    for found, density in ((of[:4], near), (of[4:], wide)):
        total = density.sum()
        assert found[0] == pytest.approx(np.log1p(total), rel=1e-4, abs=1e-6)
        deeper = (density * (seen.log_depth - here)).sum() / (total + FEW)
        assert found[1] == pytest.approx(deeper, rel=1e-3, abs=1e-5)
        mean = (density * seen.log_depth).sum() / total
        variance = (density * (seen.log_depth - mean) ** 2).sum() / (total + FEW)
        assert found[2] == pytest.approx(np.sqrt(variance), rel=1e-2, abs=1e-4)
    assert of[3] == pytest.approx((near * off).sum() / (near.sum() + FEW), rel=1e-3, abs=1e-6)
    assert of[7] == pytest.approx((wide * np.abs(off)).sum() / (wide.sum() + FEW), rel=1e-3)
    assert of[8] == pytest.approx(0.5 * wide.sum() / (wide.sum() + FEW), rel=1e-3)


def test_a_point_that_the_others_contradict_says_by_how_much(inputs):
    correction, _ = inputs
    off = correction.contradiction[correction.points.index == 0]
    assert off == pytest.approx(0.5, abs=0.15)
    assert np.abs(np.median(correction.contradiction)) < 0.05


@pytest.mark.parametrize("shape", [(64, 64), (48, 64), (30, 46), (128, 128)])
def test_maps_of_any_size_are_completed(shape):
    result = MapCompletion(OPTICS, shape)(np.ones(shape), stated(shape), points(60, shape))
    assert result.depth_m.shape == shape
    assert np.median(result.depth_m) == pytest.approx(TRUE_M, rel=0.06)
    assert (result.sigma > 0).all()
    assert np.median(result.sigma) < 0.9 * SIGMA


@pytest.mark.parametrize("why", ["dark", "states no probability of nothing"])
def test_by_points_alone_where_the_network_is_not_asked(why):
    image, given = LIT, stated()
    if why == "dark":
        image = np.zeros(SHAPE)
    else:
        given = replace(given, no_return=None)
    result = MapCompletion(OPTICS, SHAPE)(image, given, points(40))
    correction = MapCorrector(SHAPE)(np.log(given.depth_m), given.sigma, points(40))
    np.testing.assert_allclose(result.depth_m, STATED_M * np.exp(correction.error))
    factor = fitted()["kernel"]["sigma_factor"]
    np.testing.assert_allclose(result.sigma, factor * SIGMA * np.sqrt(correction.remaining))


def test_the_manifest_is_that_of_the_weights():
    manifest = json.loads(WEIGHTS.with_suffix(".json").read_text())
    assert manifest["sha256"] == hashlib.sha256(WEIGHTS.read_bytes()).hexdigest()
    assert manifest["family_aside"] not in manifest["families"]
