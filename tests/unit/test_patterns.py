"""Pattern plans: which patterns are shown, and that readings decode to Hadamard coefficients."""

import numpy as np
import pytest
from scipy.linalg import hadamard

from images import signed_coefficients
from reconstruction.base.errors import InputError, nearest
from reconstruction.operators import (
    POLARITIES,
    PatternPlan,
    expose,
    fwht,
    illumination,
    make_plan,
    mean_illumination,
    sequency,
)


@pytest.mark.parametrize("size", [1, 2, 8, 64])
def test_fwht_is_the_sylvester_matrix(size):
    assert np.array_equal(fwht(np.eye(size)), hadamard(size))


def test_fwht_works_along_any_axis_and_leaves_its_input_alone():
    x = np.random.default_rng(0).standard_normal((3, 8, 5))
    before = x.copy()
    assert np.allclose(fwht(x, axis=1), np.einsum("ij,ajb->aib", hadamard(8), x))
    assert np.array_equal(x, before)


def test_fwht_refuses_other_lengths():
    with pytest.raises(ValueError, match="12 is not a power of two"):
        fwht(np.zeros(12))


@pytest.mark.parametrize("size", [1, 2, 16, 64])
def test_sequency_counts_sign_changes(size):
    changes = (np.diff(hadamard(size), axis=1) != 0).sum(axis=1)
    assert np.array_equal(sequency(size), changes)


def test_row_is_the_outer_product_of_two_small_rows():
    plan = make_plan((4, 8), order="natural", polarity="signed")
    for k in (0, 5, 13, 31):
        expected = np.outer(hadamard(4)[k // 8], hadamard(8)[k % 8])
        assert np.array_equal(illumination(plan, k), expected)


@pytest.mark.parametrize(
    ("polarity", "exposures"), [("differential", 40), ("single-ended", 21), ("signed", 20)]
)
def test_plan_sizes(polarity, exposures):
    plan = make_plan((8, 16), 20, polarity=polarity)
    assert (plan.exposures, plan.sampled, plan.pixels) == (exposures, 20, 128)
    assert plan.sampling_ratio == 20 / 128
    assert plan.basis == "hadamard"


def test_differential_alternates_the_polarity_of_each_index():
    plan = make_plan((4, 4), 3, order="natural")
    assert plan.index.tolist() == [0, 0, 1, 1, 2, 2]
    assert plan.polarity.tolist() == [1, -1] * 3


@pytest.mark.parametrize("polarity", POLARITIES)
def test_expose_sums_the_illuminated_image(polarity):
    plan = make_plan((4, 8), 9, polarity=polarity)
    image = np.random.default_rng(1).random((2, 4, 8))
    displayed = np.stack([illumination(plan, k) for k in range(plan.exposures)])
    assert np.allclose(expose(plan, image), np.einsum("khw,fhw->fk", displayed, image))
    assert displayed.min() >= (-1 if polarity == "signed" else 0)


def test_expose_refuses_an_image_of_another_shape():
    with pytest.raises(ValueError, match="does not end in the plan's shape"):
        expose(make_plan((4, 8)), np.zeros((8, 4)))


@pytest.mark.parametrize(
    ("polarity", "background"), [("differential", 7.0), ("single-ended", 7.0), ("signed", 0.0)]
)
def test_readings_decode_to_coefficients_free_of_background(polarity, background):
    plan = make_plan((8, 16), 40, polarity=polarity)
    image = np.random.default_rng(2).random((3, 8, 16))
    index, coefficients = signed_coefficients(plan, expose(plan, image) + background)
    assert np.array_equal(np.sort(index), np.unique(plan.index))
    assert np.allclose(coefficients, fwht(image.reshape(3, -1))[:, index])


def test_a_plan_that_mixes_everything_decodes():
    # all-on, dark, complement alone, both polarities twice, and a recorder's difference
    index = np.array([0, 0, 3, 5, 5, 5, 5, 6])
    polarity = np.array([1, -1, -1, 1, -1, 1, -1, 0])
    plan = PatternPlan((2, 4), index, polarity)
    image = np.random.default_rng(3).random((2, 4))
    readings = expose(plan, image) + np.where(polarity == 0, 0, 11.0)
    result, coefficients = signed_coefficients(plan, readings)
    assert result.tolist() == [0, 3, 5, 6]
    assert np.allclose(coefficients, fwht(image.ravel())[result])


def test_decoding_needs_the_dark_and_the_all_on_exposure():
    with pytest.raises(InputError, match="background cannot be removed from pattern index 0"):
        signed_coefficients(PatternPlan((2, 2), np.array([0, 3]), np.array([1, 1])), np.zeros(2))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((12, 16),), "12 x 16: both sides must be powers of two"),
        (((2**16, 2**16), 127), "65536 x 65536: at most 16777216 pixels"),
        (((4, 4), 17), r"patterns = 17: must lie in 1\.\.16"),
        (((4, 4), 0), r"patterns = 0: must lie in 1\.\.16"),
        (((4, 4), 4, "sequncy"), "unknown pattern order 'sequncy': did you mean 'sequency'"),
        (((4, 4), 4, "natural", "diff"), "unknown polarity 'diff': .*allowed: differential"),
    ],
)
def test_bad_plans_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        make_plan(*arguments)


@pytest.mark.parametrize(
    ("index", "polarity", "message"),
    [
        ([], [], "non-empty"),
        ([0.5], [1], "integers"),
        ([4], [1], r"index 4 is outside 0\.\.3"),
        ([-1], [1], r"index -1 is outside 0\.\.3"),
        ([0, 1], [1], "for each of the 2 exposures"),
        ([0], [2], "must be -1, 0 or"),
    ],
)
def test_inconsistent_plans_are_refused(index, polarity, message):
    with pytest.raises(InputError, match=message):
        PatternPlan((2, 2), np.array(index), np.array(polarity))


def test_nearest_names_the_likely_and_the_allowed():
    assert (
        nearest("natral", ["natural", "other"]) == "did you mean 'natural'? allowed: natural, other"
    )
    assert nearest("xyz", ["natural"]) == "allowed: natural"


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_mean_illumination_is_the_mean_of_the_displayed_patterns(polarity):
    plan = make_plan((8, 4), 9, polarity=polarity)
    displayed = [illumination(plan, k) for k in range(plan.exposures)]
    np.testing.assert_allclose(mean_illumination(plan), np.mean(displayed, axis=0), atol=1e-12)
