"""Gaussian images: posterior mean and variance are those of the textbook."""

from pathlib import Path

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction.image import Coefficients, image_method
from reconstruction.image.contrast import contrasts
from reconstruction.image.dictionaries.dct import DICTIONARY
from reconstruction.image.gaussian import Field, GaussianModel
from reconstruction.image.grid import Grid, band
from reconstruction.image.methods import least_squares
from reconstruction.image.posterior import Components
from reconstruction.operators import decoder_for, make_plan

SHAPE = (8, 16)
DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def field():
    atoms = (DICTIONARY.atoms(side) for side in SHAPE)
    return Field(*atoms, DICTIONARY.sigma(SHAPE) ** 2)


@pytest.fixture(scope="module")
def rows(field):
    """Spectra of what 39 patterns see."""
    operator = decoder_for(make_plan(SHAPE, 40, polarity="signed")).operator
    images = field.image(np.eye(128).reshape(-1, *SHAPE))
    return operator.forward(images).T[1:] / operator.row_length


def drawn(field, contrast, seed):
    """The spectrum of an image of this variance."""
    white = np.random.default_rng(seed).standard_normal(SHAPE)
    return np.sqrt(contrast * field.variance) * white


def in_pixels(field, covariance):
    """Variances (N,) of pixels, from the covariance (N, N) of spectra."""
    pixels = field.image(np.eye(128).reshape(-1, *SHAPE)).reshape(128, 128).T
    return np.diag(pixels @ covariance @ pixels.T)


@pytest.mark.parametrize("noise", ["even", "uneven", "one unknown", "even, ten unknown"])
def test_the_posterior_is_that_of_the_joint_covariance(field, rows, noise):
    rng = np.random.default_rng(1)
    sigma = np.full(39, 2.0) if noise.startswith("even") else rng.uniform(0.5, 3, 39)
    measured = rows @ drawn(field, 50.0, 2).ravel() + sigma * rng.standard_normal(39)
    if noise == "one unknown":
        sigma[7], measured[7] = np.inf, 0
    if noise == "even, ten unknown":
        sigma[5:15], measured[5:15] = np.inf, 0
    posterior = GaussianModel(rows, field).given(measured, sigma)
    finite = np.isfinite(sigma)
    prior, seen = posterior.contrast * np.diag(field.variance.ravel()), rows[finite]
    gain = np.linalg.solve(seen @ prior @ seen.T + np.diag(sigma[finite] ** 2), seen @ prior).T
    covariance = prior - gain @ seen @ prior
    np.testing.assert_allclose(
        posterior.own_mean.ravel(), gain @ measured[finite], rtol=1e-4, atol=1e-4
    )
    if not noise.startswith("even"):
        exact = np.isclose(posterior.variance.ravel(), in_pixels(field, covariance), rtol=1e-4)
        assert exact.sum() >= exact.size // 16
    # What noise adds to the mean, in the prior's norm.
    spread = gain * sigma[finite] / np.sqrt(field.variance.ravel() + 1e-300)[:, None]
    exact = (spread[field.variance.ravel() > 0] ** 2).sum()
    if noise.startswith("even"):
        assert posterior.noise_energy == pytest.approx(exact, rel=1e-4)
    image = rng.standard_normal(SHAPE)
    np.testing.assert_allclose(
        posterior.covariance(image).ravel(), covariance @ image.ravel(), rtol=1e-3, atol=1e-3
    )


@pytest.mark.parametrize("sigma", [2.0, 40.0])
def test_mean_and_variance_are_averages_over_the_textbook_s(field, rows, sigma):
    """Over contrasts and exponents, of images of which only what is measured has the latter."""
    rng = np.random.default_rng(3)
    measured = rows @ drawn(field, 50.0, 2).ravel() + sigma * rng.standard_normal(39)
    model, noise = GaussianModel(rows, field), np.full(39, sigma)
    posterior = model.given(measured, noise, 20.0)
    parts = Components(field, rows, np.ones(39))
    given = contrasts(parts.turn @ measured, parts.spreads, sigma**2, 20.0)
    prior = np.diag(field.variance.ravel())
    means, variances = [], []
    basis = parts.spectra.T / parts.spread  # images that measured components stand for
    for contrasts_of, spread in zip(given.value, parts.spreads, strict=True):
        for contrast in contrasts_of:
            tilted = contrast * (prior + basis @ np.diag(spread - parts.spread) @ basis.T)
            seen = rows @ tilted
            gain = np.linalg.solve(seen @ rows.T + sigma**2 * np.eye(39), seen).T
            means.append(gain @ measured)
            # What is not measured has the contrast of the prior's own exponent, at least.
            largest = max(posterior.contrast, given.of_all)
            rest = (largest - contrast) * (prior - basis @ parts.spectra)
            variances.append(in_pixels(field, tilted - gain @ seen + rest))
    weights = given.probability.ravel()
    mean = weights @ means
    np.testing.assert_allclose(posterior.mean.ravel(), mean, atol=1e-6 * np.abs(mean).max())
    between = field.image((np.array(means) - mean).reshape(-1, *SHAPE)).reshape(-1, 128) ** 2
    variance = weights @ (np.array(variances) + between)
    np.testing.assert_allclose(posterior.variance.mean(), variance.mean(), rtol=0.02)
    assert np.std(posterior.variance.ravel() / variance) < 0.2


def test_errors_have_the_variance_that_is_told(field, rows):
    """Over images of the prior, squared errors over variances are chi squared, mean by mean."""
    model, sigma = GaussianModel(rows, field), 2.0
    ratios = []
    for seed in range(200):
        image = drawn(field, 50.0, seed)
        noise = sigma * np.random.default_rng(10_000 + seed).standard_normal(39)
        posterior = model.given(rows @ image.ravel() + noise, np.full(39, sigma))
        error = field.image(posterior.mean - image)
        ratios.append(np.mean(error**2) / posterior.variance.mean())
    z = (np.mean(ratios) - 1) / (np.std(ratios) / np.sqrt(len(ratios)))
    assert abs(z) < 4


@pytest.mark.parametrize("unit", [1e-30, 1e-20, 1e18, 1e30])
def test_the_unit_does_not_matter(field, rows, unit):
    measured = rows @ drawn(field, 50.0, 1).ravel()
    usual, other = (
        GaussianModel(rows, field).given(of * measured, np.full(39, of)) for of in (1.0, unit)
    )
    np.testing.assert_allclose(other.variance / unit**2, usual.variance, rtol=1e-4)
    np.testing.assert_allclose(other.mean / unit, usual.mean, rtol=1e-4, atol=1e-6)


def test_contrast_is_found(field, rows):
    """Of 39 coefficients the variance is known within sqrt(2 / 39), the logarithm as well."""
    model = GaussianModel(rows, field)
    logs = [
        np.log(model.given(rows @ drawn(field, 50.0, seed).ravel(), np.full(39, 0.01)).contrast)
        for seed in range(200)
    ]
    bias = -1 / 39  # of the logarithm of a mean of squares
    z = (np.mean(logs) - np.log(50.0) - bias) / (np.sqrt(2 / 39) / np.sqrt(200))
    assert abs(z) < 4


def test_a_coarser_grid_keeps_length():
    grid = Grid((4, 6), SHAPE)
    image = np.random.default_rng(0).standard_normal((4, 6))
    assert np.linalg.norm(grid.finer(image)) == pytest.approx(np.linalg.norm(image))
    np.testing.assert_allclose(grid.finer_density(np.ones((4, 6))), np.ones(SHAPE))


def test_the_band_holds_its_share():
    seen = np.outer([8.0, 1, 0.5, 0.5], [9.0, 1, 0, 0])
    assert band(seen, 0.85) == (2, 1)
    assert band(seen, 1.0) == (4, 2)


def test_least_squares_on_a_grid_is_nearly_that_on_all_pixels(monkeypatch):
    image = natural_image(64, 3)
    operator = decoder_for(make_plan(image.shape, 128, polarity="signed")).operator
    coefficients = Coefficients(operator.forward(image), np.full(128, 1.0))
    exact = image_method("least-squares").compile(operator)(coefficients)
    monkeypatch.setattr(least_squares, "MAX_NUMBERS", 127 * 32 * 32)
    anew = decoder_for(make_plan(image.shape, 128, polarity="signed")).operator
    solver = image_method("least-squares").compile(anew)
    assert solver.model.field.variance.shape == (32, 32)
    coarse = solver(coefficients)
    assert correlation(coarse.image, exact.image) > 0.995
    np.testing.assert_allclose(coarse.sigma.mean(), exact.sigma.mean(), rtol=0.05)


def test_sigma_is_no_less_than_half_the_error_where_patterns_see_columns_alone():
    """The first patterns of the natural order, of the measured car."""
    plan = make_plan((32, 32), 31, order="natural", polarity="signed")
    operator = decoder_for(make_plan((32, 32), order="natural", polarity="signed")).operator
    readings = np.load(DATA / "car_buckets_201.npy").astype(np.float64)
    image = operator.min_norm(readings)
    few = decoder_for(plan).operator
    estimate = image_method("edge-preserving").compile(few)(
        Coefficients(readings[:31], np.full(31, 1e-3 * readings[1:31].std()))
    )
    error = np.std(estimate.image - image)
    assert error < 2 * np.sqrt(np.mean(estimate.sigma**2))
