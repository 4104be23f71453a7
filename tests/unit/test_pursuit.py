"""Matching pursuit: Batch-OMP equals the textbook, and the weighted one beats zero-filling."""

from importlib import import_module
from pathlib import Path
from time import thread_time

import numpy as np
import pytest

from images import correlation, image_from, natural_image
from reconstruction.image import (
    DICTIONARIES,
    Coefficients,
    Imaging,
    batch_omp,
    fit_variance,
    image_method,
    omp,
)
from reconstruction.operators import decoder_for, fwht, make_plan

CAR = Path(__file__).parents[1] / "data" / "car_buckets_201.npy"


def textbook_omp(dictionary, measured, atoms, ridge=0.0):
    """Pati, Rezaiifar, Krishnaprasad 1993: correlate, choose, solve anew."""
    chosen, residual = [], measured
    for _ in range(atoms):
        correlation = np.abs(dictionary.T @ residual)
        correlation[chosen] = 0
        chosen.append(int(np.argmax(correlation)))
        part = dictionary[:, chosen]
        normal = part.T @ part + ridge * np.eye(len(chosen))
        values = np.linalg.solve(normal, part.T @ measured)
        residual = measured - part @ values
    result = np.zeros(dictionary.shape[1], measured.dtype)
    result[chosen] = values
    return result


def measure(image, patterns):
    index = make_plan(image.shape, patterns, polarity="signed").index
    return index, fwht(image.ravel())[index]


@pytest.fixture
def dictionary():
    columns = np.random.default_rng(0).standard_normal((40, 100))
    return columns / np.linalg.norm(columns, axis=0)


@pytest.fixture(params=["interpreted", "compiled", "in step"])
def pursuit(request, monkeypatch):
    """Batch-OMP in NumPy, compiled, and with arrays of another library; gives NumPy's."""
    if request.param == "in step":
        strict = pytest.importorskip("array_api_strict")
        pytest.importorskip("array_api_compat")

        def in_step(gram, correlation, energy, **limits):
            arrays = {name: strict.asarray(limit) for name, limit in limits.items()}
            arrays["max_atoms"] = limits["max_atoms"]
            given = map(strict.asarray, (gram, correlation, energy))
            return np.asarray(batch_omp(*given, **arrays))

        return in_step
    if request.param == "compiled":
        pytest.importorskip("numba")
    kind = import_module(f"reconstruction.image.omp.{request.param}")
    monkeypatch.setattr(omp, "pursuit_of", lambda frames: kind.pursue_frames)
    return batch_omp


@pytest.fixture
def pursued(pursuit):
    """Coefficients of frames (..., M) by a pursuit."""

    def pursue(dictionary, measured, **limits):
        energy = (np.abs(measured) ** 2).sum(axis=-1)
        return pursuit(dictionary.T @ dictionary, measured @ dictionary, energy, **limits)

    return pursue


class TestBatchOmp:
    @pytest.mark.parametrize("ridge", [0.0, 0.3])
    @pytest.mark.parametrize("turn", [0, 1j])
    def test_frames_are_pursued_as_in_the_textbook(self, pursued, dictionary, ridge, turn):
        rng = np.random.default_rng(1)
        measured = rng.standard_normal((6, 40)) + turn * rng.standard_normal((6, 40))
        result = pursued(dictionary, measured, ridge=ridge, max_atoms=15)
        expected = [textbook_omp(dictionary, each, 15, ridge) for each in measured]
        assert np.allclose(result, expected, rtol=0, atol=1e-12)
        assert np.array_equal(result != 0, np.array(expected) != 0)

    def test_a_frame_of_many_is_as_it_is_alone(self, pursuit, dictionary):
        gram = dictionary.T @ dictionary
        correlation = np.random.default_rng(2).standard_normal((2, 3, 40)) @ dictionary
        limits = {"energy": np.full((2, 3), 40.0), "ridge": 0.1, "tolerance": np.zeros((2, 3))}
        limits["tolerance"][1] = [10, 20, 30]
        together = pursuit(gram, correlation, **limits, max_atoms=20)
        for position in np.ndindex(2, 3):
            each = {
                name: np.broadcast_to(limit, (2, 3))[position] for name, limit in limits.items()
            }
            alone = pursuit(gram, correlation[position], **each, max_atoms=20)
            assert np.allclose(together[position], alone, rtol=0, atol=1e-12)
            assert np.array_equal(together[position] != 0, alone != 0)
        assert np.unique((together != 0).sum(axis=-1)).size > 1

    def test_the_pursuit_stops_at_the_tolerance_and_no_step_earlier(self, pursued, dictionary):
        measured = np.random.default_rng(3).standard_normal(40)
        for atoms in (1, 7, 8):
            result = textbook_omp(dictionary, measured, atoms, 0.2)
            left = np.sum((measured - dictionary @ result) ** 2) + 0.2 * result @ result
            limits = {"ridge": 0.2, "tolerance": left * (1 + 1e-9), "max_atoms": 40}
            assert np.allclose(pursued(dictionary, measured, **limits), result)

    def test_a_sparse_signal_is_found_and_the_pursuit_stops_there(self, pursued, dictionary):
        truth = np.zeros(100)
        truth[[7, 42, 63]] = [3.0, -2.0, 1.5]
        measured = dictionary @ truth
        energy = measured @ measured
        result = pursued(dictionary, measured, tolerance=1e-9 * energy, max_atoms=40)
        assert np.allclose(result, truth, rtol=0, atol=1e-12)
        assert np.flatnonzero(result).tolist() == [7, 42, 63]

    def test_a_repeated_column_is_taken_once(self, pursued, dictionary):
        doubled = np.hstack([dictionary[:, :5], dictionary[:, :5], np.zeros((40, 1))])
        measured = doubled @ np.arange(11.0)
        result = pursued(doubled, measured, max_atoms=11)
        assert sorted(np.flatnonzero(result) % 5) == [0, 1, 2, 3, 4]
        assert np.allclose(doubled @ result, measured)

    @pytest.mark.parametrize("atoms", [0, 4])
    def test_nothing_measured_or_allowed_takes_no_atom(self, pursued, atoms):
        measured = np.full(4, 1.0 - (atoms > 0))
        assert not pursued(np.eye(4), measured, max_atoms=atoms).any()

    def test_more_atoms_may_be_allowed_than_there_are(self, pursued):
        assert np.allclose(pursued(np.eye(4)[:3], np.arange(3.0), max_atoms=9), [0, 1, 2, 0])


def test_deviation_falls_with_spatial_frequency_in_cycles_per_pixel():
    sigma = DICTIONARIES["dct"].sigma((32, 64))
    assert sigma[0, 0] == 0
    assert sigma[0, 4] == pytest.approx(2 * sigma[0, 8])
    assert sigma[3, 0] == pytest.approx(sigma[0, 6])


def test_variance_fit_finds_signal_and_white_part():
    rng = np.random.default_rng(3)
    expected = np.logspace(2, -2, 4000)
    measured = rng.standard_normal(4000) * np.sqrt(5 * expected + 2)
    variance, white = fit_variance(measured, expected)
    assert variance == pytest.approx(5, rel=0.15)
    assert variance * white == pytest.approx(2, rel=0.15)


@pytest.mark.parametrize(
    ("patterns", "linear", "gain"), [(256, 0.97, 0.015), (102, 0.93, 0.03), (31, 0.84, 0.03)]
)
def test_measured_car_beats_zero_filling(patterns, linear, gain):
    readings = np.load(CAR).astype(float)
    full = fwht(readings).reshape(32, 32) / 1024
    index = make_plan((32, 32), patterns, polarity="signed").index
    baseline = correlation(image_from(readings[index], index, (32, 32), "zero-filled"), full)
    pursued = correlation(image_from(readings[index], index, (32, 32)), full)
    assert baseline == pytest.approx(linear, abs=0.01)
    assert pursued > baseline + gain


@pytest.mark.parametrize("patterns", [128, 410, 1024])
def test_synthetic_images_gain_at_every_sampling_ratio(patterns):
    gains = []
    for seed in range(5):
        image = natural_image(64, seed)
        index, coefficients = measure(image, patterns)
        pursued = image_from(coefficients, index, (64, 64))
        linear = image_from(coefficients, index, (64, 64), "zero-filled")
        gains.append(correlation(pursued, image) - correlation(linear, image))
    assert min(gains) > -0.002
    assert np.mean(gains) > 0.005


@pytest.mark.parametrize("shape", [(32, 32), (64, 64), (16, 64)])
def test_without_noise_full_sampling_is_exact(shape):
    image = np.random.default_rng(4).random(shape)
    index, coefficients = measure(image, None)
    assert np.allclose(image_from(coefficients, index, shape), image, atol=1e-10)


def test_without_noise_the_image_agrees_with_every_measured_coefficient():
    image = natural_image(32, 5)
    index, coefficients = measure(image, 100)
    pursued = image_from(coefficients, index, (32, 32))
    assert np.allclose(fwht(pursued.ravel())[index], coefficients)


def test_known_noise_is_suppressed():
    image = natural_image(32, 6)
    index, clean = measure(image, None)
    sigma = float(clean[1:].std())
    noisy = clean + np.random.default_rng(7).normal(0, sigma, clean.size)

    def error(method, noise=0.0):
        return np.mean((image_from(noisy, index, (32, 32), method, noise) - image) ** 2)

    linear = error("zero-filled")
    assert error("pursuit", sigma) < 0.4 * linear
    assert error("pursuit") == pytest.approx(linear)


def test_a_complex_image_turns_with_its_phase_and_is_real_where_it_may_be():
    image = natural_image(32, 11)
    index, coefficients = measure(image, 200)

    def pursued(values, noise=0.0):
        return image_from(values, index, (32, 32), noise=noise)

    turn = np.exp(0.7j)
    assert np.allclose(pursued(coefficients * turn, 3.0), pursued(coefficients, 3.0) * turn)
    other = measure(natural_image(32, 12), 200)[1]
    both = coefficients + 1j * other
    assert np.allclose(pursued(both * turn), pursued(both) * turn)
    assert np.allclose(fwht(pursued(both).ravel())[index], both)


def test_a_uniform_image_and_the_mean_alone():
    image = np.full((8, 8), 3.0)
    index, coefficients = measure(image, 20)
    assert np.allclose(image_from(coefficients, index, (8, 8)), image)
    index, coefficients = measure(natural_image(8, 8), 1)
    assert np.allclose(image_from(coefficients, index, (8, 8)), coefficients / 64)


def test_a_missing_mean_changes_the_level_only():
    image = natural_image(32, 9)
    index, coefficients = measure(image, 60)
    with_mean = image_from(coefficients, index, (32, 32))
    without = image_from(coefficients[1:], index[1:], (32, 32))
    assert np.allclose(with_mean - without, image.mean())


def test_the_set_up_is_shared_between_frames():
    imaging = Imaging(make_plan((16, 16), 30, polarity="signed"))
    usable = np.ones(30, dtype=bool)
    first = imaging.of(usable).solver("pursuit")
    assert imaging.of(usable.copy()).solver("pursuit") is first
    usable[7] = False
    assert imaging.of(usable).solver("pursuit") is first


def test_a_frame_of_64_by_64_from_128_patterns_takes_well_under_30_ms():
    """Of processor time: what else runs does not count."""
    coefficients = Coefficients(measure(natural_image(64, 10), 128)[1], np.zeros(128))
    operator = decoder_for(make_plan((64, 64), 128, polarity="signed")).operator
    solve = image_method("pursuit").compile(operator)
    seconds = []
    for _ in range(5):
        started = thread_time()
        solve(coefficients)
        seconds.append(thread_time() - started)
    assert min(seconds) < 0.03


def test_noisy_rows_are_expected_to_have_as_much_less_energy_as_they_are_weighed():
    operator = decoder_for(make_plan((16, 16), 60, polarity="signed")).operator
    operator.usual_noise = np.linspace(1, 2, 60)
    solver = image_method("pursuit").compile(operator)
    weighed, plain = (np.linalg.norm(m, axis=1) for m in (solver._columns, solver.atoms.columns))
    assert (weighed[-1] / plain[-1]) == pytest.approx(weighed[0] / plain[0] / 2, rel=0.02)
    np.testing.assert_allclose(solver._expected, (weighed / plain) ** 2 * solver.atoms.expected)
