"""Layouts of readings, told by the spectrum of images, and what is no known layout."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.fft import idctn

from images import natural_image
from reconstruction import capture_warnings
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import capture_from_readings
from reconstruction.image import (
    WITHOUT_DARK,
    candidate_layouts,
    dark_estimate,
    plan_inconsistency,
    recognise,
)
from reconstruction.image.spectra import fit, gaussian, heavy_tails, powers, spectra
from reconstruction.image.transforms import haar, other_spectra
from reconstruction.operators import (
    PatternPlan,
    RowOperator,
    expose,
    fwht,
    make_plan,
    ordered_rows,
    transposed,
)
from reconstruction.operators.bases.hadamard import Hadamard

SHAPE = (32, 32)
ORDERS = ("natural", "sequency", "sequency-2d")
LAYOUTS = [
    ("natural", "signed"),
    ("sequency", "differential"),
    ("natural", "halves"),
    ("sequency", "negative-first"),
    ("natural", "single-ended"),
    ("sequency-2d", "signed"),
]


def recorded(plan, seed, noise=0.1):
    """Readings (1, M) of a picture on a background, with noise by the spread of the readings."""
    readings = expose(plan, natural_image(32, seed)[: plan.shape[0]])
    readings += 50 * (plan.polarity != 0)
    spread = np.diff(np.percentile(readings, [16, 84])) / 2
    rng = np.random.default_rng(seed)
    return (readings + rng.normal(0, noise * spread, readings.shape))[None]


@pytest.mark.parametrize(("order", "polarity"), LAYOUTS)
def test_layouts_are_recognised_and_not_doubted(order, polarity):
    plan = make_plan(SHAPE, 400, order, polarity)
    readings = recorded(plan, 3)
    result = recognise(readings, SHAPE)
    assert result[0].layout.polarity == polarity
    # Several orders go by sums of frequencies, and are as likely.
    assert order in ("sequency-2d", result[0].layout.order)
    assert result[0].probability > (0.2 if order == "sequency-2d" else 0.9)
    assert plan_inconsistency(plan, readings) is None


def test_probabilities_are_of_all_that_is_known():
    plan = make_plan(SHAPE, 60, "sequency-2d", "signed")
    result = recognise(recorded(plan, 4), SHAPE)
    assert sum(candidate.probability for candidate in result) == pytest.approx(1)
    assert result == sorted(result, key=lambda candidate: -candidate.probability)


def test_pixels_numbered_by_columns_are_told_where_sides_differ():
    plan = transposed(make_plan((32, 16), 300, "sequency", "signed"))
    best = recognise(recorded(plan, 5), (16, 32))[0].layout
    assert (best.order, best.transposed) == ("sequency", True)
    np.testing.assert_array_equal(best.plan.index, plan.index)


def test_transposed_plans_show_transposed_patterns():
    plan = make_plan((4, 8), order="sequency", polarity="signed")
    image = np.random.default_rng(1).random((8, 4))
    np.testing.assert_allclose(expose(transposed(plan), image), expose(plan, image.T))


@pytest.mark.parametrize(
    ("displayed", "reported"),
    [("natural", "natural"), ("natural", "sequency-2d"), ("sequency", "natural")],
)
def test_another_order_is_doubted(displayed, reported):
    readings = recorded(make_plan(SHAPE, order=displayed, polarity="differential"), 6)
    result = plan_inconsistency(make_plan(SHAPE, order=reported, polarity="differential"), readings)
    assert (result is None) == (displayed == reported)
    if result:
        assert f"they look like order {displayed}, polarity differential" in result


def test_polarities_in_another_sequence_are_doubted():
    readings = recorded(make_plan(SHAPE, 100, "sequency", "halves"), 7)
    result = plan_inconsistency(make_plan(SHAPE, 100, "sequency", "differential"), readings)
    assert "polarity halves" in result


def test_noise_is_not_doubted_and_not_recognised():
    rng = np.random.default_rng(8)
    readings = rng.normal(500, 3, (1, 800))
    assert plan_inconsistency(make_plan(SHAPE, 400), readings) is None
    with pytest.raises(InputError, match="no known layout explains the 800 readings better than"):
        recognise(readings, SHAPE)


def test_an_order_that_nobody_knows_is_doubted_and_not_recognised():
    readings = recorded(make_plan(SHAPE, order="natural", polarity="signed"), 9)
    readings[:, 1:] = np.random.default_rng(9).permutation(readings[:, 1:], axis=1)
    result = plan_inconsistency(make_plan(SHAPE, order="natural", polarity="signed"), readings)
    assert "match neither the pattern plan's order" in result
    with pytest.raises(InputError, match="no known layout explains"):
        recognise(readings, SHAPE)


def test_coefficients_of_other_transforms_are_told():
    """Haar wavelets of -1, 0 and 1 in a pyramid, read as Hadamard's."""
    pyramid = np.zeros(SHAPE)
    size, means = 32, natural_image(32, 10)
    signs = np.array([[1, 1], [1, -1]])
    while size > 1:
        half = size // 2
        blocks = means.reshape(half, 2, half, 2)
        means, across, down, diagonal = np.einsum("ipjq,ap,bq->abij", blocks, signs, signs).reshape(
            4, half, half
        )
        pyramid[:half, half:size], pyramid[half:size, :half] = across, down
        pyramid[half:size, half:size] = diagonal
        size = half
    pyramid[0, 0] = means[0, 0]
    for order in ORDERS:
        plan = make_plan(SHAPE, order=order, polarity="signed")
        assert "look like Haar wavelet coefficients" in plan_inconsistency(
            plan, pyramid.reshape(1, -1)
        )
    with pytest.raises(InputError, match="look like Haar wavelet coefficients, in a pyramid"):
        recognise(pyramid.reshape(1, -1), SHAPE)


CAR = Path(__file__).parents[1] / "data" / "car_buckets_201.npy"


@pytest.mark.parametrize("tall", ["natural", "dyadic", "sequency"])
@pytest.mark.parametrize("wide", ["natural", "dyadic", "sequency"])
@pytest.mark.parametrize("seed", [None, pytest.param(4, marks=pytest.mark.slow)])
def test_hadamard_coefficients_are_none_of_haar(tall, wide, seed):
    """Of a real recording and of a picture, in orders of software that have no name here."""
    basis = Hadamard(SHAPE)
    if seed is None:
        values = np.load(CAR).ravel()
    else:
        values = expose(
            make_plan(SHAPE, order="natural", polarity="signed"), natural_image(32, seed)
        )
    side = Hadamard((1, 32))
    rows = np.add.outer(32 * ordered_rows(side, tall), ordered_rows(side, wide)).ravel()
    readings = values[None, rows]
    for order in (*ORDERS, "walsh-2d"):
        declared = ordered_rows(basis, order).astype(np.int32)
        plan = PatternPlan(SHAPE, declared, np.zeros(1024, np.int8), order, basis)
        assert not re.search("Haar|cosine", plan_inconsistency(plan, readings) or "")
    assert recognise(readings, SHAPE)


def test_a_dark_reading_is_estimated():
    plan = make_plan(SHAPE, order="natural", polarity="single-ended").only(np.arange(1025) < 1024)
    readings = recorded(plan, 11, noise=0)
    assert recognise(readings, SHAPE)[0].layout.polarity == WITHOUT_DARK
    assert dark_estimate(plan, readings[0]) == pytest.approx(50, abs=5)


def test_recordings_are_warned_of_and_simulations_are_not():
    plan = make_plan(SHAPE, order="sequency", polarity="signed")
    readings = recorded(make_plan(SHAPE, order="natural", polarity="signed"), 12)
    capture = capture_from_readings(readings, plan, untrusted=[0])
    assert "look like order natural" in capture_warnings(capture)[0]
    object.__setattr__(capture.provenance, "source", "simulation")
    assert not any("look like" in warning for warning in capture_warnings(capture))


def test_all_zero_frames_are_told():
    plan = make_plan(SHAPE, order="natural", polarity="signed")
    reported = capture_warnings(capture_from_readings(np.zeros(1024), plan))
    assert reported == ["all 1024 bucket readings are equal: there is no image in them"]


def test_plans_of_other_repetitions_cannot_be_doubted():
    plan = PatternPlan(SHAPE, np.array([0, 1, 1, 2]), np.zeros(4))
    assert plan_inconsistency(plan, np.arange(4.0)[None]) is None


def test_known_layouts_have_so_many_readings():
    for exposures in (64, 65, 128):
        result = list(candidate_layouts((8, 8), exposures))
        assert result
        assert all(layout.plan.exposures == exposures for layout in result)
    assert not list(candidate_layouts((8, 8), 129))


def test_spectra_are_those_of_images_with_that_spectrum():
    """By chance: Hadamard and pyramid coefficients of images drawn with a power of cosines."""
    shape, draws = (8, 8), 4000
    rng = np.random.default_rng(13)
    power = powers(shape)[4]
    drawn = rng.normal(size=(draws, *shape)) * np.sqrt(power)
    images = idctn(drawn, axes=(1, 2), norm="ortho")
    measured = (fwht(images.reshape(draws, 64)) ** 2).mean(axis=0)[1:] / 64
    expected = spectra(RowOperator(Hadamard(shape), np.arange(64, dtype=np.int32)))[4]
    assert np.abs(measured / expected - 1).max() < 5 * np.sqrt(2 / draws)
    seen = dict(other_spectra(shape))["Haar wavelet coefficients, axis by axis"][4]
    measured = ((haar(8) @ images @ haar(8).T) ** 2).mean(axis=0).ravel()[1:]
    assert np.abs(measured / seen[1:] - 1).max() < 5 * np.sqrt(2 / draws)


def test_displayed_wavelets_are_as_long_as_the_root_of_their_pixels():
    """Of -1 and 1 on 2 x 2 pixels, then 4 x 4, then all 8 x 8, as a variance."""
    in_signs, unit = (
        dict(other_spectra((8, 8)))[f"Haar wavelet coefficients, in a pyramid{words}"][4]
        for words in (" of patterns of -1, 0 and 1", "")
    )
    pixels = np.full((8, 8), 4)
    pixels[:4, :4], pixels[:2, :2] = 16, 64
    np.testing.assert_allclose(in_signs[1:] / unit[1:], pixels.ravel()[1:])


def test_likelihoods_are_greatest_ones():
    """Of Gaussian values: Student's t of 30 degrees of freedom is hardly worse than Gauss."""
    values = np.random.default_rng(14).normal(0, 3, 5000)
    closed = -2500 * (np.log(2 * np.pi * np.mean(values**2)) + 1)
    assert gaussian(values) == pytest.approx(closed)
    result = fit(values, np.ones((1, 5000)))
    assert closed - 40 < result.white < closed + 5
    assert result.gain == pytest.approx(0, abs=1e-6)
    assert heavy_tails(values) < 0 < heavy_tails(values**3)
