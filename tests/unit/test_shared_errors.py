"""Errors that all coefficients share: found by what images hardly excite, and taken off."""

from dataclasses import replace

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction import Capture, PatternPlan, make_plan, reconstruct
from reconstruction.capture import Buckets
from reconstruction.image import Imaging, without_shared_errors
from reconstruction.operators import decoder_for, expose, fwht

SHAPE = (32, 32)
NOISE = 300.0


def recorded(capture, image, plan, seed, noise=NOISE):
    """A capture of an image with shot and amplifier noise, without any where that is nan or 0."""
    readings = expose(plan, image)[None]
    if noise > 0:
        rng = np.random.default_rng(seed)
        readings = rng.poisson(readings) + rng.normal(0, noise, readings.shape)
    buckets = Buckets(
        counts=readings,
        saturated=np.zeros(readings.shape, dtype=bool),
        exposure_time_s=np.nan,
        pattern_period_s=np.nan,
        electrons_per_count=1.0,
        offset_counts=0.0,
        noise_electrons=noise,
        excess_noise_factor=1.0,
        dead_time_s=0.0,
    )
    return replace(capture, plan=plan, buckets=buckets, spots=None, optics=None, truth=None)


def decoded(capture):
    """Coefficients as the plan decodes them, with all errors."""
    return decoder_for(capture.plan).decode(capture.buckets.signal[0])


def measured(capture):
    """Rows, coefficients without what they share, and their noise."""
    buckets = capture.buckets
    readings = Imaging(capture.plan).of(buckets.usable[0])
    coefficients = readings.decode(buckets.signal[0], buckets.variance[0])
    return readings.decoder.index, coefficients.values, coefficients.noise


def image_like(seed):
    return 40 * natural_image(32, seed)


def test_two_shared_readings_are_the_generalised_least_squares_of_the_formula():
    plan = make_plan((4, 4), 9, polarity="single-ended")
    rng = np.random.default_rng(0)
    variance = rng.uniform(1, 2, plan.exposures)
    prior = np.append(np.inf, rng.uniform(0.1, 50, plan.sampled - 1))
    coefficients = rng.normal(0, 5, plan.sampled)
    decoder = decoder_for(plan)
    result, left = without_shared_errors(
        decoder.shared_columns(),
        coefficients,
        own=decoder.own_variance(variance),
        shared=variance[decoder.shared],
        prior=prior,
    )

    # The posterior mean and variance of the shared errors, from the joint covariance.
    matrix = decoder.matrix @ np.eye(plan.exposures)
    weight_of_dc = 1e9  # stands for an unknown level
    image = np.diag(np.append(weight_of_dc, prior[1:]))
    covariance = image + matrix @ np.diag(variance) @ matrix.T
    shared = matrix[:, [0, -1]]
    cross = np.diag(variance[[0, -1]]) @ shared.T
    errors = cross @ np.linalg.solve(covariance, coefficients)
    np.testing.assert_allclose(result, coefficients - shared @ errors, rtol=1e-5)
    posterior = np.diag(variance[[0, -1]]) - cross @ np.linalg.solve(covariance, cross.T)
    own = 4 * np.append(0, variance[1:-1])
    expected = own + np.diag(shared @ posterior @ shared.T)
    np.testing.assert_allclose(left, expected, rtol=1e-5)


def test_one_common_number_is_the_weighted_mean_of_the_docstring():
    plan = make_plan((4, 4), 9, polarity="single-ended")
    decoder = decoder_for(plan)
    variance = np.ones(plan.exposures)
    variance[-1] = 0  # the dark reading is sure: only the all-on reading errs
    prior = np.linspace(0.1, 9, 8)
    coefficients = np.random.default_rng(1).normal(0, 3, 8)
    weight = 1 / (prior + 4)
    common = (weight * coefficients).sum() / (weight.sum() + 1)
    result, _ = without_shared_errors(
        decoder.shared_columns()[1:],  # all rows but the level
        coefficients,
        own=decoder.own_variance(variance)[1:],
        shared=variance[decoder.shared],
        prior=prior,
    )
    np.testing.assert_allclose(result, coefficients - common)


@pytest.mark.parametrize("polarity", ["differential", "signed"])
def test_plans_without_shared_readings_are_left_alone(capture: Capture, polarity: str) -> None:
    one = recorded(capture, image_like(1), make_plan(SHAPE, 200, polarity=polarity), 1, 0.0)
    one = replace(one, buckets=replace(one.buckets, noise_electrons=NOISE))
    _, coefficients, noise = measured(one)
    assert np.array_equal(coefficients, decoded(one))
    variance = np.abs(one.buckets.signal[0]) + NOISE**2
    assert noise == pytest.approx(np.sqrt(np.median(decoder_for(one.plan).matrix ** 2 @ variance)))


@pytest.mark.parametrize("noise", [np.nan, 0.0])
def test_without_noise_nothing_changes_but_for_shot_noise_that_might_be(
    capture: Capture, noise: float
) -> None:
    image = image_like(2)
    one = recorded(capture, image, make_plan(SHAPE, polarity="single-ended"), 2, noise)
    _, coefficients, _ = measured(one)
    exact = fwht(image.ravel())[one.plan.distinct]
    if np.isnan(noise):
        assert correlation(reconstruct(one).image, image) > 0.99
    else:
        assert np.abs(coefficients - exact).max() < 2 * np.sqrt(image.sum())


def test_a_dark_capture_is_dark(capture: Capture) -> None:
    plan = make_plan(SHAPE, 100, polarity="single-ended")
    dark = recorded(capture, np.zeros(SHAPE), plan, 0, noise=0.0)
    silent = replace(dark.buckets, noise_electrons=NOISE)
    for buckets in (dark.buckets, silent):
        assert not reconstruct(replace(dark, buckets=buckets)).image.any()


@pytest.mark.parametrize("patterns", [128, 400, 1024])
def test_the_false_pixel_in_the_corner_is_gone(capture: Capture, patterns: int) -> None:
    """The dark reading alone is off, by ten times its noise at worst."""
    image = image_like(3)
    one = recorded(capture, image, make_plan(SHAPE, patterns, polarity="single-ended"), 3, 0.0)
    error = 10 * NOISE
    counts = one.buckets.counts.copy()
    counts[0, -1] += error
    outliers = replace(one, buckets=replace(one.buckets, counts=counts, noise_electrons=error))
    _, coefficients, _ = measured(outliers)
    exact = fwht(image.ravel())[one.plan.distinct]
    assert np.allclose(decoded(outliers)[1:] - exact[1:], -error)
    common = np.mean(coefficients[1:] - exact[1:])
    assert abs(common) < 0.2 * error


def test_noisy_images_improve_on_average_and_never_lose_much(capture: Capture) -> None:
    plan = make_plan(SHAPE, 128, polarity="single-ended")
    gains = []
    for seed in range(20):
        image = image_like(seed)
        one = recorded(capture, image, plan, seed)
        plain = np.zeros(plan.pixels)
        plain[plan.distinct] = decoded(one)
        zero_filled = fwht(plain).reshape(SHAPE) / plan.pixels
        corrected = reconstruct(one).images["zero-filled"]
        gains.append(correlation(corrected, image) - correlation(zero_filled, image))
    assert np.mean(gains) > 0.02
    assert np.mean(np.array(gains) > 0) > 0.7  # by chance, the error may be next to nothing
    assert min(gains) > -0.03


def test_the_error_left_is_as_large_as_it_says(capture: Capture) -> None:
    """Over many draws of the noise, coefficients but the level scatter with the variance given."""
    plan = make_plan(SHAPE, 128, polarity="single-ended")
    image = image_like(4)
    exact = fwht(image.ravel())[plan.distinct]
    errors, noises = [], []
    for seed in range(200):
        _, coefficients, noise = measured(recorded(capture, image, plan, seed))
        errors.append((coefficients - exact)[1:])
        noises.append(noise)
    scatter = np.sqrt(np.median(np.var(errors, axis=0)))
    assert scatter == pytest.approx(np.mean(noises), rel=0.05)


def test_a_plan_that_mixes_both_kinds_is_fine(capture: Capture) -> None:
    index = np.array([0, 0, 3, 5, 5, 6, 9, 12])
    polarity = np.array([1, -1, -1, 1, -1, 1, 1, 0])
    plan = PatternPlan((4, 4), index, polarity)
    image = np.random.default_rng(3).uniform(100, 900, (4, 4))
    one = recorded(capture, image, plan, 0, noise=5.0)
    rows, coefficients, _ = measured(one)
    raw = decoded(one)
    alone = np.isin(rows, [5, 12])
    assert np.array_equal(coefficients[alone], raw[alone])
    assert np.all(coefficients[~alone] != raw[~alone])
