"""Methods of making images, on images that none of them knows."""

from functools import cache

import numpy as np
import pytest

from images import correlation, image_from, natural_image
from reconstruction.image import Coefficients, Estimate, image_method
from reconstruction.image.methods import IMAGE_METHODS
from reconstruction.operators import decoder_for, make_plan

SIDE = 32
PATTERNS = 64
METHODS = tuple(IMAGE_METHODS)


@cache
def compiled(name, shape, patterns):
    """A solver, and the operator of its coefficients."""
    operator = decoder_for(make_plan(shape, patterns, polarity="signed")).operator
    return image_method(name).compile(operator), operator


def estimate(name, image, *, snr=None, seed=0, patterns=PATTERNS):
    """What a method makes of an image; noise is the coefficients' rms over ``snr``."""
    solve, operator = compiled(name, image.shape, patterns)
    values = operator.forward(image)
    noise = 0.0 if snr is None else float(np.std(values[1:])) / snr
    values = values + noise * np.random.default_rng(seed).standard_normal(values.shape)
    return solve(Coefficients(values, np.full(values.shape, noise)))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("shape", [(32, 32), (16, 64), (64, 16), (4, 4)])
def test_every_method_gives_an_estimate_of_the_shape_whole_or_not(name, shape):
    image = natural_image(64, 0)[: shape[0], : shape[1]]
    result = estimate(name, image, snr=20, patterns=image.size // 8)
    assert isinstance(result, Estimate)
    assert result.image.shape == shape
    assert np.isfinite(result.image).all()
    assert result.sigma is None or (result.sigma >= 0).all()


@pytest.mark.parametrize("name", METHODS)
def test_a_flat_image_is_flat_and_a_dark_one_dark(name):
    flat = np.full((SIDE, SIDE), 3.0)
    np.testing.assert_allclose(estimate(name, flat).image, flat, atol=1e-9)
    np.testing.assert_allclose(estimate(name, 0 * flat).image, 0, atol=1e-12)


@pytest.mark.parametrize("name", METHODS)
def test_the_level_alone_gives_a_flat_image(name):
    result = image_from(np.array([30.0]), np.array([0], dtype=np.int32), (4, 4), name)
    np.testing.assert_allclose(result, np.full((4, 4), 30 / 16))


@pytest.mark.parametrize("name", METHODS)
def test_images_scale_with_their_readings(name):
    image = natural_image(SIDE, 1)
    once, more = (estimate(name, scale * image, snr=10).image for scale in (1.0, 1e6))
    np.testing.assert_allclose(1e6 * once, more, rtol=1e-4, atol=1e-3 * more.max())


@pytest.mark.parametrize("name", ["least-squares", "edge-preserving", "random-pursuit"])
def test_without_noise_the_image_agrees_with_the_readings(name):
    image = natural_image(SIDE, 2)
    operator = decoder_for(make_plan(image.shape, PATTERNS, polarity="signed")).operator
    values = operator.forward(image)
    result = image_method(name).compile(operator)(Coefficients(values, np.zeros(PATTERNS)))
    misfit = np.abs(operator.forward(result.image) - values).max()
    assert misfit < 1e-3 * np.std(values[1:])


@pytest.mark.parametrize(("snr", "minimum"), [(None, 2), (10, 2), (3, -2), (1, -2)])
def test_edges_are_worth_following_and_never_cost(snr, minimum):
    """Correlation over that of least squares, by standard errors of the mean."""
    gains = []
    for seed in range(20):
        image = natural_image(64, 100 + seed)
        plain, followed = (
            correlation(estimate(name, image, snr=snr, seed=seed, patterns=128).image, image)
            for name in ("least-squares", "edge-preserving")
        )
        gains.append(followed - plain)
    assert np.mean(gains) > minimum * np.std(gains) / np.sqrt(len(gains))


@pytest.mark.parametrize("name", ["least-squares", "edge-preserving", "random-pursuit"])
@pytest.mark.parametrize("snr", [10, 2])
def test_deviations_are_the_size_of_errors(name, snr):
    """Images are no Gaussian fields: within a factor, and half to nine tenths within one sigma."""
    ratios, within = [], []
    for seed in range(20):
        image = natural_image(SIDE, 200 + seed)
        result = estimate(name, image, snr=snr, seed=seed)
        error = np.abs(result.image - image)
        ratios.append(np.mean(error**2) / np.mean(result.sigma**2))
        within.append(np.mean(error < result.sigma))
    assert 0.5 < np.mean(ratios) < 2
    assert 0.5 < np.mean(within) < 0.9


def test_total_variation_agrees_within_the_noise_and_is_least():
    image = np.zeros((SIDE, SIDE))
    image[8:20, 6:25] = 1.0
    operator = decoder_for(make_plan(image.shape, 200, polarity="signed")).operator
    values = operator.forward(image)
    noise = np.full(200, 0.05)
    result = image_method("total-variation").compile(operator)(Coefficients(values, noise)).image
    misfit = np.linalg.norm(operator.forward(result)[1:] - values[1:])
    assert misfit <= 1.01 * np.linalg.norm(noise)

    def variation(of):
        down, along = np.diff(of, axis=0)[:, :-1], np.diff(of, axis=1)[:-1]
        return np.hypot(down, along).sum()

    assert variation(result) < 1.02 * variation(image)
    assert correlation(result, image) > 0.99


def test_a_complex_image_keeps_its_phase():
    image = natural_image(SIDE, 4) * np.exp(0.7j)
    operator = decoder_for(make_plan(image.shape, PATTERNS, polarity="signed")).operator
    values = operator.forward(image)
    for name in ("least-squares", "edge-preserving", "total-variation"):
        solve = image_method(name).compile(operator)
        result = solve(Coefficients(values, np.full(PATTERNS, 0.1))).image
        assert np.abs(np.angle(result * np.exp(-0.7j))).max() < 1e-3, name
