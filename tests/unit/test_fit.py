"""Fits to recordings: expected readings and their Jacobian, information, and bad input."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
from reconstruction import Capture, InputError
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim_compare.gaussian import Covariance
from spisim_inverse.fit.information import Information
from spisim_inverse.fit.model import Model
from spisim_inverse.fit.page import write_fit
from spisim_inverse.fit.parameters import Parameter, available, parameters
from spisim_inverse.fit.pose import PoseErrors
from spisim_inverse.fit.priors import Prior
from spisim_inverse.fit.readings import Readings
from spisim_inverse.fit.result import in_words
from spisim_inverse.fit.tracing import Tracer
from spisim_inverse.fit.twin import Twin
from spisim_inverse.fit.view import View
from twoboards import (
    BOARD,
    DARK,
    FRAMES,
    GAIN,
    HIDDEN,
    LASER,
    OFFSET,
    POWER,
    SPP,
    VISIBILITY,
    boards,
    fitted,
    instrument_of,
    recorded,
)


def model_of(names: list[str], capture: Capture, scene: Scene, instrument: Instrument) -> View:
    twin = Twin.of(scene, instrument, capture)
    chosen = parameters(twin, dict.fromkeys(names))
    return View(Readings.of(capture), twin, chosen, Tracer(0), 0, PoseErrors((0.0, 0.0), 0))


def coordinates(model: View) -> np.ndarray:
    return np.array([each.coordinate(each.start) for each in model.parameters])


def without_steady(model: View, counts: np.ndarray) -> np.ndarray:
    """Taps less the mean of each spot, which holds steady light: its derivative is left out."""
    counts = counts.copy()
    for spot in range(1, 1 + int(model.readings.group.max())):
        own = model.readings.group == spot
        counts[own] -= counts[own].mean()
    return counts


class TestModel:
    def test_expects_what_a_simulation_without_noise_records(self):
        scene, instrument = boards(), instrument_of()
        model = model_of([LASER], recorded(), scene, instrument)
        light = model.tracer(model.twin, [], SPP).light
        expected = model.readings.expected(model.twin, light)
        made = recorded()
        error = np.sqrt(expected.variance / FRAMES)
        z = (model.readings.mean - expected.counts) / np.hypot(error, 0.02 * expected.counts)
        assert np.abs(z).max() < 4
        assert model.readings.patterns == made.plan.exposures
        assert len(model.readings.names) == model.readings.mean.size

    @pytest.mark.parametrize(("name", "same"), [
        (BOARD, 0.01), (GAIN, 1e-6), (DARK, 1e-6), (OFFSET, 1e-4), (LASER, 1e-6), (POWER, 1e-6),
        ("projector.on_off_contrast", 1e-3), ("detector.sensor.dark_current_na", 1e-6),
    ])  # fmt: skip
    def test_jacobian_is_the_difference_of_expected_readings(self, name, same):
        instrument = instrument_of(projector={"on_off_contrast": 50.0})
        model = model_of([name], recorded(), boards(), instrument)
        start, step = coordinates(model), 0.02
        ends = [model.expected(start + sign * step, SPP).counts for sign in (1, -1)]
        slope = without_steady(model, (ends[0] - ends[1]) / (2 * step))
        column = without_steady(model, model.jacobian(start, SPP)[:, 0])
        assert np.abs(column - slope).max() < (same + step**2) * np.abs(slope).max()

    def test_visibility_and_extinction_change_the_readings_alike(self):
        columns = []
        for name in (VISIBILITY, "scene.fog.extinction_per_m"):
            model = model_of([name], recorded(), boards(), instrument_of())
            columns.append(model.jacobian(coordinates(model), SPP)[:, 0])
        np.testing.assert_allclose(columns[0], -columns[1], rtol=1e-6, atol=1e-9)

    def test_throughput_acts_on_the_exposures_of_its_pattern(self):
        model = model_of(["throughput"], recorded(), boards(), instrument_of())
        start = coordinates(model)
        whole = model.jacobian(start, SPP)
        moved = start.copy()
        moved[3] += 0.02
        change = (model.expected(moved, SPP).counts - model.expected(start, SPP).counts) / 0.02
        mean = whole.sum(axis=1) / start.size
        slope = whole[:, 3] - mean  # the instrument keeps the mean
        assert np.abs(change - slope).max() < 0.02 * np.abs(slope).max()
        off, gauge = Model([model]).gauge(start)
        assert off == pytest.approx(0.0, abs=1e-6)
        assert gauge.shape == (1, start.size)

    def test_histograms_are_counted_in_groups(self):
        capture = recorded(60.0, "spad")
        model = model_of([LASER], capture, boards(), instrument_of("spad"))
        light = model.tracer(model.twin, [], SPP).light
        expected = model.readings.expected(model.twin, light)
        total = capture.spots.counts.sum(axis=(1, 2)).mean()
        spots = slice(model.readings.patterns, None)
        assert model.readings.mean[spots].sum() == pytest.approx(total)
        assert expected.counts[spots].sum() == pytest.approx(total, rel=0.1)

    def test_bins_scatter_as_photons_of_so_many_pulses(self):
        """Of n pulses, each fills a bin with the probability p: n p (1 - p)."""
        capture = recorded(60.0, "spad")
        model = model_of([LASER], capture, boards(), instrument_of("spad"))
        light = model.tracer(model.twin, [], SPP).light
        expected = model.readings.expected(model.twin, light)
        counts, variance = (each[model.readings.patterns :] for each in vars(expected).values())
        pulses = instrument_of("spad").tof.pulses
        p = counts / pulses
        np.testing.assert_allclose(variance, np.maximum(pulses * p * (1 - p), 1 / 12))


class TestInformation:
    def free(self, *names: str) -> list[Parameter]:
        return [
            Parameter(name, "1", 1.0, (0.1, 10.0), True, False, lambda twin, value: twin)
            for name in names
        ]

    def test_covariance_is_its_inverse(self):
        rng = np.random.default_rng(0)
        slope = rng.normal(size=(20, 3)) * [1.0, 100.0, 1e-3]
        information = Information.of(self.free("a", "b", "c"), slope)
        np.testing.assert_allclose(information.covariance, np.linalg.inv(slope.T @ slope))
        assert not information.indistinct
        assert information.condition >= 1

    def test_names_what_is_not_determined(self):
        slope = np.random.default_rng(0).normal(size=(20, 3))
        slope[:, 1] = 2 * slope[:, 0]
        information = Information.of(self.free("a", "b", "c"), slope)
        assert information.indistinct
        assert information.weakest == "a · b^-0.5"

    def test_parameters_without_information(self):
        slope = np.random.default_rng(0).normal(size=(20, 2))
        slope[:, 1] = 0
        free = self.free("a", "b")
        information = Information.of(free, slope)
        assert information.uninformed == free[1:]
        assert list(information.only(free[:1]).parameters) == free[:1]


class TestBadInput:
    def test_what_the_recording_does_not_depend_on_is_reported(self):
        result = fitted({HIDDEN: None, BOARD: None})
        assert result.uninformed == [HIDDEN]
        assert [each.name for each in result.estimates] == [BOARD]
        assert any(HIDDEN in line for line in result.warnings)
        with pytest.raises(InputError, match="nothing can be fitted"):
            fitted({HIDDEN: None})

    def test_a_scene_that_cannot_fit(self, tmp_path):
        far = replace(boards(), drone_pose=boards().drone_pose + 0.0)
        far.drone_pose[1, 3] -= 1.0
        result = fitted({BOARD: None}, scene=far)
        assert not result.fits
        assert "does not fit" in result.warnings[-1]
        assert result.worst
        assert "Largest differences" in in_words(result)[-1]
        write_fit(tmp_path / "fit.html", "fit", "A wall too far", result)
        lead = (tmp_path / "fit.html").read_text().partition("</h1>")[2].partition("</p>")[0]
        assert "the model does not fit" in lead

    def test_spots_that_disagree_say_how_far_their_mean_is_off(self):
        rng, spots, bins = np.random.default_rng(2), 9, 40
        by_spot = 5 * rng.standard_normal(spots)
        readings = np.repeat(by_spot, bins) + rng.standard_normal(spots * bins)
        difference = readings - readings.mean()
        information = Information.of(TestInformation().free("mean"), np.ones((readings.size, 1)))
        noise = Covariance(np.ones(readings.size), np.zeros((readings.size, 0)))
        scores = difference.reshape(spots, bins).sum(axis=1, keepdims=True)
        of_mean = replace(
            fitted({BOARD: None}), coordinates=np.zeros(1), information=information, noise=noise,
            difference=difference, scores=np.vstack([np.zeros(1), scores]),
        )  # fmt: skip
        means = readings.reshape(spots, bins).mean(axis=1)
        sigma = np.sqrt(of_mean.covariance[0, 0])
        assert sigma == pytest.approx(means.std(ddof=1) / np.sqrt(spots))
        alone = replace(of_mean, scores=scores.sum(axis=0, keepdims=True))
        assert alone.scale[0] == pytest.approx(readings.std(ddof=1))

    def test_scores_of_all_groups_add_up_to_nothing_at_the_maximum(self):
        result = fitted({BOARD: None, LASER: None})
        each = result.scores @ result.information.covariance / np.sqrt(np.diag(result.covariance))
        assert np.abs(each.sum(axis=0)).max() < 0.3
        assert np.abs(each).max() > 0.3

    def test_an_estimate_at_its_bound(self):
        capture = recorded()
        bright = replace(
            capture.buckets,
            counts=capture.buckets.offset_counts
            + 5 * (capture.buckets.counts - capture.buckets.offset_counts),
        )
        result = fitted({BOARD: None}, replace(capture, buckets=bright))
        assert result.at_bounds == [BOARD]
        assert any("at its bound" in line for line in result.warnings)

    @pytest.mark.parametrize(("free", "message"), [
        ({}, "nothing is free"),
        ({"scene.fog.visibilty_m": None}, "did you mean 'scene.fog.visibility_m'"),
        ({"materials.bord": None}, "did you mean 'materials.board'"),
        ({VISIBILITY: None, "scene.fog.extinction_per_m": None}, "one parameter"),
        ({BOARD: 1.5}, "must be from 0.002 to 0.999"),
        ({BOARD: float("nan")}, "must be from"),
        ({"projector.on_off_contrast": None}, "give a start"),
        ({"throughput": 2.0}, "no single start"),
        ({"buckets.electrons_per_count": 0.0}, r"=0: must be from 1e-09 to 1e\+12"),
        ({"buckets.electrons_per_count": -1.0}, r"=-1: must be from 1e-09 to 1e\+12"),
        ({"buckets.electrons_per_count": float("nan")}, r"=nan: must be from 1e-09 to 1e\+12"),
        ({"buckets.offset_counts": 1e300}, r"=1e\+300: must be from -1e\+12 to 1e\+12"),
    ])  # fmt: skip
    def test_parameters(self, free, message):
        twin = Twin.of(boards(), instrument_of(), recorded())
        with pytest.raises(InputError, match=message):
            parameters(twin, free)

    def test_factors_of_patterns_stay_positive(self):
        twin = Twin.of(boards(), instrument_of(), recorded())
        chosen = parameters(twin, {"throughput": None})
        assert len(chosen) == 15
        assert all(each.positive and not each.changes_light for each in chosen)
        covered = np.sum([each.exposures for each in chosen], axis=0)
        np.testing.assert_array_equal(covered, np.ones(recorded().plan.exposures))

    def test_clear_air_has_no_fog_to_fit(self):
        twin = Twin.of(boards(None), instrument_of(), recorded(None))
        assert VISIBILITY not in available(twin)
        with pytest.raises(InputError, match=r"air of scene boards is clear.*--visibility"):
            parameters(twin, {VISIBILITY: 100.0})

    @pytest.mark.parametrize(("prior", "message"), [
        (Prior(float("nan"), 1.0), "must be finite"),
        (Prior(1.0, float("nan")), "sigma is nan"),
        (Prior(1.0, 0.0), "sigma is 0"),
    ])  # fmt: skip
    def test_priors_that_are_no_distribution(self, prior, message):
        with pytest.raises(InputError, match=message):
            fitted({BOARD: None}, priors={BOARD: prior})

    def test_priors_of_what_is_not_free(self):
        with pytest.raises(InputError, match="not free"):
            fitted({BOARD: None}, priors={HIDDEN: Prior(1.0, 1.0)})

    def test_a_capture_of_another_instrument(self):
        with pytest.raises(InputError, match="another instrument: patterns: shape is"):
            fitted({BOARD: None}, instrument=spisim.load_instrument("paper"))

    def test_what_moves(self):
        moving = replace(boards(), drone_velocity_m_s=(0.0, 1.0, 0.0))
        with pytest.raises(InputError, match="moves"):
            fitted({BOARD: None}, scene=moving)

    def test_readings_of_unknown_scale(self):
        capture = recorded()
        unknown = replace(capture.buckets, electrons_per_count=np.nan)
        with pytest.raises(InputError, match="electrons_per_count is unknown"):
            fitted({BOARD: None}, replace(capture, buckets=unknown))
