"""Noise of patterns that are not orthogonal: weak directions are shrunk, never cut."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.fft import idctn
from scipy.linalg import hadamard

from images import correlation, natural_image
from reconstruction import Reconstructor
from reconstruction.capture.importers import capture_from_readings
from reconstruction.image import Coefficients, image_method
from reconstruction.operators import decoder_for, expose, illumination, plan_of_rows
from reconstruction.operators.bases.dense import Dense

SIDE = 8
KINDS = ("binary", "sparse", "gaussian", "hadamard", "cosine")


def displayed(kind, patterns, rng):
    """Transmittances (patterns, SIDE, SIDE) from 0 to 1."""
    shape = (patterns, SIDE, SIDE)
    if kind == "binary":
        return rng.integers(0, 2, shape).astype(float)
    if kind == "sparse":
        return (rng.random(shape) < 0.1).astype(float)
    if kind == "gaussian":
        return np.clip(0.5 + rng.standard_normal(shape) / 8, 0, 1)
    if kind == "hadamard":
        return (1 + hadamard(SIDE**2)[rng.permutation(SIDE**2)[:patterns]].reshape(shape)) / 2
    units = np.eye(SIDE**2)[np.argsort(np.add.outer(*2 * [np.arange(SIDE)]).ravel())[:patterns]]
    cosines = idctn(units.reshape(shape), axes=(1, 2), norm="ortho")
    return 0.5 + 0.5 * cosines / np.abs(cosines).max(axis=(1, 2), keepdims=True)


def smooth_image(seed):
    return natural_image(8 * SIDE, seed).reshape(SIDE, 8, SIDE, 8).mean(axis=(1, 3))


def ridge(plan, readings, sigma, truth):
    """White images of the true contrast and of any level, over any background."""
    seen = np.array([illumination(plan, k).ravel() for k in range(plan.exposures)], np.float64)
    white = truth.var() * np.eye(truth.size) + 1e4 * truth.mean() ** 2
    background = 0.0 if (plan.polarity == 0).all() else 1e4 * readings.var()
    of_readings = seen @ white @ seen.T + sigma**2 * np.eye(plan.exposures) + background
    return (white @ seen.T @ np.linalg.solve(of_readings, readings)).reshape(truth.shape)


def recorded(plan, readings, sigma):
    capture = capture_from_readings(readings, plan)
    buckets = replace(capture.buckets, electrons_per_count=1.0, noise_electrons=sigma)
    return replace(capture, buckets=replace(buckets, excess_noise_factor=1e-12))


@pytest.mark.parametrize("polarity", ["signed", "differential", "+1"])
def test_an_image_of_stated_noise_is_no_worse_than_a_ridge_regression(polarity):
    """Half as many patterns as pixels, and as many, of which some directions are hardly told;
    signal of a reading over its noise of 0.65, 2 and 20."""
    gains = {0.65: [], 2.0: [], 20.0: []}
    seed = 0
    for kind in KINDS:
        for patterns in (SIDE**2 // 2, SIDE**2):
            for snr, gained in gains.items():
                seed += 1
                rng = np.random.default_rng(seed)
                truth = smooth_image(seed)
                sequence = [1] * patterns if polarity == "+1" else polarity
                basis = Dense(displayed(kind, patterns, rng))
                plan = plan_of_rows(basis, np.arange(patterns), sequence)
                light = expose(plan, truth)
                sigma = float(np.std(light)) / snr
                readings = light + sigma * rng.standard_normal(light.shape)
                capture = recorded(plan, readings, sigma)
                result = Reconstructor(capture.setup)(capture.frame())
                assert np.ptp(result.image) > 0, kind
                reference = correlation(ridge(plan, readings, sigma, truth), truth)
                gained.append(correlation(result.image, truth) - reference)
    for snr, gained in gains.items():
        assert np.mean(gained) > -2 * np.std(gained) / np.sqrt(len(gained)), snr
    assert np.mean(gains[20.0]) > 0


@pytest.mark.parametrize("polarity", ["signed", "differential", "+1"])
def test_white_noise_of_readings_makes_independent_errors_of_the_usual_size(polarity):
    patterns = 40
    sequence = [1] * patterns if polarity == "+1" else polarity
    basis = Dense(displayed("binary", patterns, np.random.default_rng(0)))
    decoder = decoder_for(plan_of_rows(basis, np.arange(patterns), sequence))
    rows = decoder.operator.matrix
    np.testing.assert_allclose(rows @ rows.T, np.eye(len(rows)), atol=1e-10)
    covariance = (decoder.matrix @ decoder.matrix.T)[np.ix_(*2 * [decoder.operator.varying])]
    usual = decoder.operator.usual_noise[decoder.operator.varying]
    np.testing.assert_allclose(covariance, np.diag(usual**2), atol=1e-10 * usual.max() ** 2)


def test_total_variation_agrees_within_noise_of_any_sizes():
    rng = np.random.default_rng(2)
    truth = smooth_image(2)
    basis = Dense(displayed("binary", 50, rng))
    operator = decoder_for(plan_of_rows(basis, np.arange(50), "signed")).operator
    noise = 0.02 * operator.usual_noise / np.median(operator.usual_noise)
    values = operator.forward(truth) + noise * rng.standard_normal(noise.shape)
    result = image_method("total-variation").compile(operator)(Coefficients(values, noise)).image
    misfit = ((operator.forward(result) - values) / noise)[operator.varying]
    assert np.linalg.norm(misfit) <= 1.01 * np.sqrt(misfit.size)
    assert correlation(result, truth) > 0.8
