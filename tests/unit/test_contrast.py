"""Contrasts that noise hides: averages over all, against integrals and draws from the prior."""

import numpy as np
import pytest

from images import natural_image
from reconstruction.image import Coefficients
from reconstruction.image.contrast import ContrastByDc, contrasts, shrunk
from reconstruction.image.noise import NoiseLevels
from reconstruction.image.prior import RELATIVE, SPREAD
from reconstruction.operators import decoder_for, make_plan


def spectra(components):
    """Variances that fall with two powers of the number."""
    numbers = np.arange(1, components + 1)
    return np.array([1.0 / numbers, 1.0 / numbers**2])


def drawn(seed, components, noise, expected):
    """Components, and what is measured of them, of an image that the prior expects."""
    rng = np.random.default_rng(seed)
    contrast = expected * np.exp(2 * SPREAD * rng.standard_normal())
    signal = rng.standard_normal(components) * np.sqrt(
        contrast * rng.choice(spectra(components), axis=0)
    )
    return signal, signal + noise * rng.standard_normal(components)


@pytest.mark.parametrize("noise", [0.03, 1.0, 10.0])
@pytest.mark.parametrize("components", [5, 100])
def test_errors_of_images_of_the_prior_have_the_variance_that_is_told(components, noise):
    """Squared errors less the variance are 0 on the mean, however strong the noise."""
    excess, errors = [], []
    for seed in range(400):
        signal, measured = drawn(seed, components, noise, 2.0)
        given = contrasts(measured, spectra(components), noise**2, 2.0)
        result = shrunk(given, spectra(components), noise**2)
        error = (result.gain * measured - signal) ** 2
        excess.append((error - result.by_noise - result.between * measured**2).sum())
        errors.append(error.sum())
    assert abs(np.mean(excess)) < 4 * np.std(excess) / np.sqrt(len(excess))
    assert np.mean(excess) < 0.25 * np.mean(errors)


@pytest.mark.parametrize("expected", [None, 2.0])
@pytest.mark.parametrize("components", [3, 40, 1000])
@pytest.mark.parametrize("noise", [1e-4, 1.0, 30.0])
def test_a_few_contrasts_are_the_integral_over_all(components, noise, expected):
    _, measured = drawn(1, components, noise, 2.0)
    spread = spectra(components)[:1]
    given = contrasts(measured, spread, noise**2, expected)
    logs = np.linspace(-40, 25, 20_001)
    variance = np.exp(logs)[:, None] * spread[0] + noise**2
    density = -(np.log(variance) + measured**2 / variance).sum(axis=1) / 2
    if expected is None:
        size = logs + np.log(spread.max() / noise**2)
        density += size - 2 * np.logaddexp(0, size)
    else:
        density -= ((logs - np.log(expected)) / (2 * SPREAD)) ** 2 / 2
    weight = np.exp(density - density.max())
    weight /= weight.sum()
    exact = weight @ (np.exp(logs)[:, None] * spread[0] / variance)
    result = shrunk(given, spread, noise**2).gain
    np.testing.assert_allclose(result, exact, rtol=0.1 if expected is None else 0.03)


def test_what_is_told_of_the_level_hardly_matters_where_noise_is_weak():
    _, measured = drawn(0, 300, 1e-3, 2.0)
    result = [
        contrasts(measured, spectra(300), 1e-6, expected).given[0] for expected in (None, 0.2, 20.0)
    ]
    np.testing.assert_allclose(result, result[0], rtol=0.03)


def test_contrasts_have_the_unit_of_what_is_measured():
    _, measured = drawn(0, 30, 1.0, 2.0)
    one = contrasts(measured, spectra(30), 1.0, 2.0)
    other = contrasts(1e6 * measured, spectra(30), 1e12, 2e12)
    np.testing.assert_allclose(other.value, 1e12 * one.value)
    np.testing.assert_allclose(other.probability, one.probability, atol=1e-9)
    phase = contrasts(measured * np.exp(0.7j), spectra(30), 1.0, 2.0)
    np.testing.assert_allclose(phase.probability, one.probability, atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, np.zeros(30)])
def test_without_noise_nothing_is_shrunk(noise):
    _, measured = drawn(0, 30, 1.0, 2.0)
    given = contrasts(measured, spectra(30), noise, None)
    np.testing.assert_allclose(shrunk(given, spectra(30), noise).gain, 1)


def test_the_level_tells_what_contrast_to_expect():
    image = natural_image(16, 0)
    operator = decoder_for(make_plan(image.shape, 40, polarity="signed")).operator
    expect = ContrastByDc(operator, 3.0)
    values, noise = operator.forward(image), np.full(40, 2.0)
    square = image.mean() ** 2 + (2.0 / image.size) ** 2
    result = expect(Coefficients(values, noise))
    assert result == pytest.approx(RELATIVE**2 * square / 3.0)
    noise[operator.dc_row] = np.inf
    assert expect(Coefficients(values, noise)) is None
    assert expect(Coefficients(0 * values, np.zeros(40))) is None


def test_without_a_level_nothing_is_expected():
    plan = make_plan((16, 16), 40, polarity="signed")
    usable = plan.index != plan.patterns.dc_row
    operator = decoder_for(plan, usable).operator
    assert operator.dc_row is None
    coefficients = Coefficients(np.ones(operator.shape[0]), np.ones(operator.shape[0]))
    assert ContrastByDc(operator, 1.0)(coefficients) is None


def test_levels_of_noise_are_averaged_over():
    """Means and mean squares over the levels are those of each level by itself."""
    _, measured = drawn(3, 20, 1.0, 2.0)
    levels = NoiseLevels(np.array([0.5, 1.0, 2.0]), np.array([0.2, 0.5, 0.3]))
    given = contrasts(measured, spectra(20), 1.0, 2.0, levels)
    result = shrunk(given, spectra(20), 1.0, levels)
    each = [
        shrunk(contrasts(measured, spectra(20), variance, 2.0), spectra(20), variance)
        for variance in levels.sigma**2
    ]
    gain, square = (
        levels.probability @ np.array([part(one) for one in each])
        for part in (lambda one: one.gain, lambda one: one.gain**2 + one.between)
    )
    np.testing.assert_allclose(result.gain, gain, rtol=1e-9)
    np.testing.assert_allclose(result.between, square - gain**2, rtol=1e-6, atol=1e-12)
    by_noise = levels.probability @ np.array([one.by_noise for one in each])
    np.testing.assert_allclose(result.by_noise, by_noise, rtol=1e-9)
