"""Noise of recordings that do not tell it."""

import numpy as np
import pytest

from images import correlation, natural_image
from reconstruction.capture.importers import plan_from_matrix
from reconstruction.image import Imaging, Prior
from reconstruction.image.localised import Localised, block_differences
from reconstruction.image.noise import levels_by_spectrum, variance_by_repetition
from reconstruction.operators import (
    PatternPlan,
    decoder_for,
    drift_of,
    expose,
    make_plan,
    redundant_combinations,
)

SHAPE = (16, 16)


def repeated(polarity):
    """A plan of 20 patterns that is shown three times."""
    plan = make_plan(SHAPE, 20, polarity=polarity)
    return PatternPlan(SHAPE, np.tile(plan.index, 3), np.tile(plan.polarity, 3))


@pytest.mark.parametrize(
    ("plan", "rows"),
    [
        (make_plan(SHAPE, 30, polarity="differential"), 29),
        (make_plan(SHAPE, 30, polarity="single-ended"), 0),
        (make_plan(SHAPE, 30, polarity="signed"), 0),
        (repeated("signed"), 40),
        (repeated("differential"), 80 + 19),
    ],
    ids=["differential", "single-ended", "signed", "repeated", "both"],
)
def test_light_cancels_and_noise_does_not(plan, rows):
    usable = np.ones(plan.exposures, dtype=bool)
    combinations = redundant_combinations(plan, usable)
    assert combinations.shape == (rows, plan.exposures)
    background = np.where(plan.polarity == 0, 0.0, 17.0)
    light = expose(plan, natural_image(16, 0)) + background
    np.testing.assert_allclose(combinations @ light, 0, atol=1e-10)
    np.testing.assert_allclose((combinations**2) @ np.ones(plan.exposures), 1)


def test_saturated_readings_tell_nothing():
    plan = make_plan(SHAPE, 30, polarity="differential")
    usable = np.ones(plan.exposures, dtype=bool)
    usable[4] = False
    combinations = redundant_combinations(plan, usable)
    assert combinations.shape[0] == 28
    assert not np.isin(combinations.columns, [4, 5]).any()


def test_repetition_tells_the_noise_whatever_drifts_and_flickers():
    plan = make_plan((32, 32), 400, polarity="differential")
    combinations = redundant_combinations(plan, np.ones(plan.exposures, dtype=bool))
    light = expose(plan, natural_image(32, 1)) + 50 + np.linspace(0, 20, plan.exposures)
    result = []
    for seed in range(40):
        readings = light + 0.5 * np.random.default_rng(seed).standard_normal(light.shape)
        readings[seed] += 100
        result.append(variance_by_repetition(combinations, readings))
    # The median of n magnitudes errs by 1.17 / sqrt(2 n), neighbours are half dependent.
    z = (np.mean(np.sqrt(result)) - 0.5) / (np.std(np.sqrt(result)) / np.sqrt(40))
    assert abs(z) < 4
    assert np.std(np.sqrt(result)) < 0.5 * 0.15


def interspersed_dark(patterns):
    """A single-ended plan with a dark exposure after every fourth pattern."""
    plan = make_plan((32, 32), patterns, polarity="single-ended")
    index, sign = plan.index.tolist(), plan.polarity.tolist()
    for position in range(len(index) - 1, 0, -4):
        index.insert(position, 0)
        sign.insert(position, -1)
    return PatternPlan((32, 32), np.array(index), np.array(sign))


@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_an_offset_that_drifts_is_told_by_what_is_shown_twice(noise):
    plan = interspersed_dark(200)
    drift = drift_of(plan, np.ones(plan.exposures, dtype=bool))
    time = np.linspace(-1, 1, plan.exposures)
    true = 30 * time - 12 * time**2
    light = expose(plan, natural_image(32, 1)) + 50
    white = noise * np.random.default_rng(0).standard_normal(light.shape)
    np.testing.assert_allclose(drift(light + true + white), true, atol=1e-6 + 2 * noise)


def test_without_a_drift_hardly_a_recording_has_one():
    plan = interspersed_dark(200)
    drift = drift_of(plan, np.ones(plan.exposures, dtype=bool))
    light = expose(plan, natural_image(32, 1)) + 50
    reported = [
        drift(light + np.random.default_rng(seed).standard_normal(light.shape)).any()
        for seed in range(1000)
    ]
    assert sum(reported) <= 5  # one is expected, at most


def test_images_of_drifting_offsets_are_those_of_steady_ones():
    plan = interspersed_dark(200)
    usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))
    light = expose(plan, natural_image(32, 1)) + 50
    variance = np.full(light.shape, 1e-4)
    steady = usable.decode(light, variance).values
    drifting = usable.decode(light + np.linspace(0, 200, light.size), variance).values
    np.testing.assert_allclose(drifting, steady, atol=1e-3)


@pytest.mark.parametrize("polarity", ["signed", "single-ended"])
def test_nothing_shown_twice_tells_no_drift(polarity):
    plan = make_plan((32, 32), 200, polarity=polarity)
    assert drift_of(plan, np.ones(plan.exposures, dtype=bool)) is None


def test_too_few_repetitions_are_none():
    plan = make_plan(SHAPE, 8, polarity="differential")
    combinations = redundant_combinations(plan, np.ones(plan.exposures, dtype=bool))
    assert variance_by_repetition(combinations, np.zeros(plan.exposures)) is None


@pytest.mark.parametrize("patterns", [64, 256])
def test_the_spectrum_tells_strong_noise_and_takes_texture_for_weak_one(patterns):
    operator = decoder_for(make_plan((32, 32), patterns, polarity="signed")).operator
    expected = Prior(operator).expected
    strong, none = [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        signal = operator.forward(natural_image(32, seed))[1:] / 32
        noise = 2 * signal.std()
        white = noise * rng.standard_normal(signal.shape)
        strong.append(levels_by_spectrum(signal + white, expected).mean / noise)
        none.append(levels_by_spectrum(signal, expected).mean / signal.std())
    assert np.median(strong) == pytest.approx(1, abs=0.25)
    assert np.median(none) < 0.6


@pytest.mark.parametrize("patterns", [128, 512])
def test_noise_that_hides_the_image_is_told_without_bias(patterns):
    """Of K Gaussian numbers the deviation is known within 1 / sqrt(2 K)."""
    operator = decoder_for(make_plan((32, 32), patterns, polarity="signed")).operator
    expected = Prior(operator).expected
    ratios = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        signal = operator.forward(natural_image(32, seed))[1:] / 32
        noise = 10 * signal.std()
        white = noise * rng.standard_normal(signal.shape)
        ratios.append(levels_by_spectrum(signal + white, expected).mean / noise)
    assert abs(np.mean(ratios) - 1) < 0.04
    assert np.std(ratios) < 2 / np.sqrt(2 * patterns)


def test_few_readings_of_a_clean_image_are_not_taken_for_noise():
    """A guess that takes fine detail for noise costs .09; one that takes noise for detail, too."""
    plan = make_plan((32, 32), 31, polarity="signed")
    usable = Imaging(plan).of(np.ones(31, dtype=bool))
    solve = usable.solver("edge-preserving")
    lost = {0.0: [], 0.3: []}
    for seed in range(40, 60):
        image = natural_image(64, seed).reshape(32, 2, 32, 2).mean(axis=(1, 3))
        light = expose(plan, image)
        rms = np.sqrt(np.mean(light[1:] ** 2))
        for noise, each in lost.items():
            readings = light + noise * rms * np.random.default_rng(seed).standard_normal(31)
            sigma = max(noise, 1e-4) * rms
            unknown, reported = (
                correlation(solve(usable.decode(readings, np.full(31, variance))).image, image)
                for variance in (np.nan, sigma**2)
            )
            each.append(reported - unknown)
    for noise, each in lost.items():
        assert np.mean(each) < 0.02, noise


def test_strong_noise_is_told_by_the_contrast_that_the_level_lets_expect():
    operator = decoder_for(make_plan((32, 32), 31, polarity="signed")).operator
    expected = Prior(operator).expected
    white = np.random.default_rng(0).standard_normal(30)
    usual, reported = (levels_by_spectrum(white, expected, each) for each in (None, 1e-4))
    assert reported.mean > usual.mean
    np.testing.assert_allclose(reported.probability.sum(), 1)
    np.testing.assert_allclose(usual.relative.mean, 1)


def test_nothing_has_no_noise():
    assert levels_by_spectrum(np.zeros(5), np.arange(1.0, 6)).mean == 0


def test_an_unknown_scale_does_not_change_what_is_told_of_the_noise():
    plan = make_plan((32, 32), 100, polarity="signed")
    readings = expose(plan, natural_image(32, 2))
    readings = readings + readings[1:].std() * np.random.default_rng(3).standard_normal(100)
    usable = Imaging(plan).of(np.ones(100, dtype=bool))
    no_return = np.full(100, np.nan)
    once, more = (usable.decode(scale * readings, no_return).noise for scale in (1, 1e6))
    np.testing.assert_allclose(1e6 * once, more, rtol=1e-6)
    assert (once > 0).all()


def test_more_readings_than_pixels_tell_the_noise():
    rng = np.random.default_rng(3)
    displayed = rng.integers(0, 2, (180, 120)).astype(np.float64)
    plan, _ = plan_from_matrix(displayed, (10, 12))
    usable = np.ones(plan.exposures, dtype=bool)
    usable[7] = False
    combinations = redundant_combinations(plan, usable)
    assert combinations.shape == (58, 180)
    light = expose(plan, rng.random((10, 12))) + 3.0
    np.testing.assert_allclose(combinations @ light, 0, atol=1e-9)
    result = [
        variance_by_repetition(combinations, light + 0.5 * rng.standard_normal(light.shape))
        for _ in range(200)
    ]
    z = (np.mean(np.sqrt(result)) - 0.5) / (np.std(np.sqrt(result)) / np.sqrt(len(result)))
    assert abs(z) < 4


def test_the_mean_of_an_image_is_measured_unless_its_reading_is_lost():
    plan = make_plan((8, 8), 20, polarity="signed")
    imaging, usable = Imaging(plan), np.ones(plan.exposures, dtype=bool)
    assert imaging.of(usable).has_dc
    usable[plan.index == plan.patterns.dc_row] = False
    assert not imaging.of(usable).has_dc


def test_noise_is_estimated_from_the_coefficients_that_were_measured():
    """Of white readings without pairs, also where some failed."""
    plan = make_plan((32, 32), 300, polarity="signed")
    rng = np.random.default_rng(4)
    light = expose(plan, natural_image(32, 2)) + 40 * rng.standard_normal(plan.exposures)
    usable, unknown = np.ones(plan.exposures, dtype=bool), np.full(plan.exposures, np.nan)
    imaging = Imaging(plan)
    whole = imaging.of(usable).decode(light, unknown).noise
    usable[100:140] = False
    some = imaging.of(usable).decode(light, unknown).noise
    assert np.isinf(some).sum() == 40
    assert np.median(some[np.isfinite(some)]) == pytest.approx(np.median(whole), rel=0.2)


def strokes(seed):
    """Three bright bars on a dark ground, (64, 64)."""
    rng = np.random.default_rng(seed)
    image = np.zeros((64, 64))
    for _ in range(3):
        row, column = rng.integers(8, 40, 2)
        tall, wide = rng.permutation([rng.integers(4, 9), rng.integers(14, 25)])
        image[row : row + tall, column : column + wide] = 1.0
    return image


@pytest.mark.parametrize("noise", [1e-3, 0.1])
def test_strokes_on_a_dark_ground_are_not_taken_for_noise(noise):
    """Their coefficients are as white as noise, their blocks are not."""
    plan = make_plan((64, 64), 128, polarity="signed")
    usable = Imaging(plan).of(np.ones(128, dtype=bool))
    solve = usable.solver("edge-preserving")
    lost_db = []
    for seed in range(12):
        image = strokes(seed)
        light = expose(plan, image)
        sigma = noise * np.sqrt(np.mean(light[1:] ** 2))
        readings = light + sigma * np.random.default_rng(seed).standard_normal(128)
        unknown, stated = (
            np.std(solve(usable.decode(readings, np.full(128, variance))).image - image)
            for variance in (np.nan, sigma**2)
        )
        lost_db.append(20 * np.log10(unknown / stated))
    assert np.mean(lost_db) < 0.5


@pytest.mark.parametrize("side", [1, 7, 16])
def test_differences_of_blocks_are_orthonormal(side):
    atoms = block_differences(side)
    np.testing.assert_allclose(atoms.T @ atoms, np.eye(side), atol=1e-12)


def test_white_noise_stays_white_where_patterns_resolve_blocks():
    """Also of some patterns alone; random ones resolve none."""
    localised = Localised(decoder_for(make_plan((16, 16), 40, polarity="signed")).operator)
    given = np.arange(39) % 5 != 0
    for some in (np.ones(39, dtype=bool), given):
        turn = localised(some)
        np.testing.assert_allclose(turn @ turn.T, np.eye(some.sum()), atol=1e-12)
    scattered = decoder_for(make_plan((32, 32), 100, order="random:3", polarity="signed")).operator
    assert Localised(scattered)(np.ones(scattered.varying.sum(), dtype=bool)) is None
