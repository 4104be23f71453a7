"""Dictionaries of images: what their atoms are, how strong, and what a pursuit sees of them."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import hadamard

from drawn_images import FITTED
from images import correlation, image_from, natural_image
from reconstruction import InputError
from reconstruction.image import DICTIONARIES, StrongestAtoms
from reconstruction.image.dictionaries import learned
from reconstruction.image.dictionaries.dct import DICTIONARY as COSINES
from reconstruction.operators import MatrixOperator, decoder_for, fwht, make_plan

CAR = Path(__file__).parents[1] / "data" / "car_buckets_201.npy"
SHAPES = [(64, 64), (32, 32), (64, 16), (128, 16), (256, 16), (16, 64), (4, 4), (1, 8)]
OWN = ("dct", "haar", "db4", "learned")
TIGHT = ("dct", "haar", "db4")


@pytest.fixture(params=OWN)
def name(request):
    if request.param == "db4":
        pytest.importorskip("pywt")
    return request.param


def atoms(name, shape):
    """All atoms (A, H, W) of a dictionary and their deviations (A,)."""
    bands = DICTIONARIES[name].bands(shape)
    images = [np.einsum("ha,wb->abhw", band.vertical, band.horizontal) for band in bands]
    flat = [each.reshape(-1, *shape) for each in images]
    return np.concatenate(flat), np.concatenate([band.sigma.ravel() for band in bands])


@pytest.mark.parametrize("shape", SHAPES)
def test_images_of_every_shape_have_atoms(name, shape):
    for band in DICTIONARIES[name].bands(shape):
        assert (len(band.vertical), len(band.horizontal)) == shape
        assert band.sigma.shape == (band.vertical.shape[1], band.horizontal.shape[1])
        assert np.isfinite(band.vertical).all()
        assert np.isfinite(band.horizontal).all()
        assert (band.sigma >= 0).all()


@pytest.mark.parametrize("shape", [(8, 8), (16, 4), (12, 20), (7, 9)])
@pytest.mark.parametrize("tight", TIGHT)
def test_an_image_is_the_sum_of_what_it_has_of_all_atoms(tight, shape):
    """A tight frame: nothing is lost and nothing counted twice, edges included."""
    if tight == "db4":
        pytest.importorskip("pywt")
    images, _ = atoms(tight, shape)
    image = np.random.default_rng(0).random(shape)
    parts = np.einsum("ahw,hw->a", images, image)
    np.testing.assert_allclose(np.einsum("a,ahw->hw", parts, images), image, atol=1e-9)


def test_haars_wavelets_of_whole_blocks_are_orthonormal():
    images, _ = atoms("haar", (8, 8))
    np.testing.assert_allclose(
        np.einsum("ahw,bhw->ab", images, images), np.eye(64), rtol=0, atol=1e-12
    )


def test_daubechies_wavelets_do_not_see_cubic_slopes():
    """Four vanishing moments, where the edge does not cut them off."""
    pytest.importorskip("pywt")
    finest = DICTIONARIES["db4"].bands((32, 32))[0].horizontal
    position = np.linspace(-1, 1, 32)
    inside = np.flatnonzero((np.abs(finest) > 0).sum(axis=0) == 8)
    assert inside.size > 8
    for power in range(4):
        assert np.abs(position**power @ finest[:, inside]).max() < 1e-9
    assert np.abs(position**4 @ finest[:, inside]).max() > 1e-6


def test_atoms_are_as_strong_as_in_a_field_of_independent_cosines(name):
    shape = (8, 16)
    tall, wide = (COSINES.atoms(side) for side in shape)
    cosines = np.einsum("ha,wb->abhw", tall, wide)
    power = COSINES.sigma(shape) ** 2
    images, sigma = atoms(name, shape)
    products = np.einsum("khw,abhw->kab", images, cosines)
    np.testing.assert_allclose(sigma**2, np.einsum("kab,ab->k", products**2, power), atol=1e-9)


def test_what_is_constant_has_no_strength(name):
    images, sigma = atoms(name, (16, 16))
    even = np.ptp(images.reshape(len(images), -1), axis=1) < 1e-12
    assert sigma[even] == pytest.approx(0, abs=1e-6)


def test_wavelets_that_another_package_tells_are_asked_for(monkeypatch):
    monkeypatch.setitem(sys.modules, "pywt", None)
    with pytest.raises(InputError, match=r"'db4' needs PyWavelets: pip install 'spisim\[wavelets"):
        DICTIONARIES["db4"].bands((8, 8))
    assert DICTIONARIES["haar"].bands((8, 8))


class TestLearned:
    def test_it_is_small_and_holds_numbers_alone(self):
        assert learned.FILE.stat().st_size < 200_000
        profiles = np.load(learned.FILE, allow_pickle=False)
        assert profiles.shape[::2] == (2, learned.SIDE)
        np.testing.assert_allclose(np.linalg.norm(profiles, axis=2), 1, rtol=1e-5)

    def test_the_manifest_tells_what_it_was_learned_from(self):
        manifest = json.loads(learned.FILE.with_suffix(".json").read_text())
        assert set(manifest["families"]) == set(FITTED)
        assert manifest["atoms"] == np.load(learned.FILE, allow_pickle=False).shape[1]
        assert all(len(digest) == 64 for digest in manifest["images"].values())
        for families in ("fitted", "other"):
            result = manifest[f"left_of_{families}_families"]
            assert result["learned"] < 0.8 * result["cosines"]

    def test_neighbouring_squares_add_up(self):
        window = learned.WINDOW**2
        half = learned.SIDE // 2
        np.testing.assert_allclose(window[:half] + window[half:], 1)

    def test_any_image_is_made_of_it(self):
        images, _ = atoms("learned", (16, 16))
        image = natural_image(16, 3)
        basis = images.reshape(len(images), -1).T
        values = np.linalg.lstsq(basis, image.ravel(), rcond=1e-6)[0]
        left = np.linalg.norm(basis @ values - image.ravel())
        assert left < 0.02 * np.linalg.norm(image)


class TestStrongestAtoms:
    SHAPE = (8, 16)

    @pytest.fixture(params=["by factors", "as a matrix"])
    def operator(self, request):
        plan = make_plan(self.SHAPE, 30, polarity="signed")
        if request.param == "by factors":
            return decoder_for(plan).operator
        return MatrixOperator(hadamard(128)[plan.distinct] / np.sqrt(128), self.SHAPE)

    def test_they_are_those_that_rows_see_most_of(self, name, operator):
        result = StrongestAtoms(operator, DICTIONARIES[name], 40)
        images, sigma = atoms(name, self.SHAPE)
        seen = operator.forward(images)[:, operator.varying] / operator.row_length
        energy = (seen * sigma[:, None]) ** 2
        np.testing.assert_allclose(result.expected, energy.sum(axis=0), atol=1e-9)
        strongest = np.sort(energy.sum(axis=1))[:-41:-1]
        assert result.columns.shape == (29, 40)
        np.testing.assert_allclose((result.columns**2).sum(axis=0), strongest, atol=1e-9)

    def test_their_images_are_what_the_rows_see(self, name, operator):
        result = StrongestAtoms(operator, DICTIONARIES[name], 40)
        values = np.random.default_rng(2).standard_normal((3, 40))
        images = result.image(values)
        seen = operator.forward(images) / operator.row_length
        np.testing.assert_allclose(seen[:, operator.varying], values @ result.columns.T, atol=1e-9)
        np.testing.assert_allclose(images.mean(axis=(1, 2)), 0, atol=1e-12)
        np.testing.assert_allclose(result.image(values[0] * (1 + 2j)), images[0] * (1 + 2j))

    def test_fewer_atoms_than_wanted_are_all(self, operator):
        assert StrongestAtoms(operator, DICTIONARIES["dct"], 1000).columns.shape == (29, 128)


class TestPursuit:
    def test_without_noise_the_image_agrees_with_every_coefficient(self, name):
        image = natural_image(32, 5)
        index = make_plan((32, 32), 100, polarity="signed").index
        values = fwht(image.ravel())[index]
        result = image_from(values, index, (32, 32), f"pursuit:{name}")
        np.testing.assert_allclose(fwht(result.ravel())[index], values, atol=1e-6 * values.max())

    def test_the_level_is_that_of_its_coefficient(self, name):
        image = natural_image(16, 6)
        index = make_plan((16, 16), 40, polarity="signed").index
        values = fwht(image.ravel())[index]
        result = image_from(values, index, (16, 16), f"pursuit:{name}", noise=3.0)
        assert result.mean() == pytest.approx(image.mean())

    @pytest.mark.parametrize("dictionary", ["haar", "learned"])
    def test_the_measured_car_beats_zero_filling(self, dictionary):
        readings = np.load(CAR).astype(float)
        full = fwht(readings).reshape(32, 32) / 1024
        index = make_plan((32, 32), 31, polarity="signed").index
        baseline, pursued = (
            correlation(image_from(readings[index], index, (32, 32), method), full)
            for method in ("zero-filled", f"pursuit:{dictionary}")
        )
        assert pursued > baseline + 0.03

    def test_least_squares_has_no_dictionary(self):
        with pytest.raises(InputError, match="'least-squares' uses no dictionary"):
            image_from(np.ones(1), np.zeros(1, np.int32), (4, 4), "least-squares:haar")
