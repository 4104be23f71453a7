"""Two recordings of what should be the same: tests of equality, unknown noise, and bad input."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest
from typer.testing import CliRunner

from reconstruction import InputError, first_patterns, make_plan, write_capture
from reconstruction.capture import Poses
from reconstruction.capture.schema import between
from sameplane import FRAMES, recorded, scaled, with_readings
from spisim_app.cli import app
from spisim_compare import command as compare_command
from spisim_compare.arrays import compare_arrays, read_array
from spisim_compare.comparing import compare
from spisim_compare.comparison import in_words, named, parameters, probability
from spisim_compare.histograms import MIN_COUNTS, HistogramModel, joined_bins
from spisim_compare.judging import ALARM
from spisim_compare.noise import noise_of
from spisim_compare.patterns import common_noise, patterns_mean
from spisim_compare.reading import compare_files


class TestCaptures:
    def test_equal_captures_raise_no_alarm(self):
        comparison = compare(recorded(1), recorded(2))
        assert named(comparison.verdict) == "equal"
        assert comparison.verdict.probability > ALARM
        assert in_words(comparison)[0].startswith("Equal within the noise")

    def test_it_is_antisymmetric(self):
        one, other = recorded(1), scaled(recorded(2), 1.1)
        forth, back = compare(one, other), compare(other, one)
        np.testing.assert_allclose(forth.z, -back.z, atol=1e-6)
        assert named(forth.verdict) == named(back.verdict)

    @pytest.mark.parametrize("factor", [0.5, 0.95, 1.05, 2.0])
    def test_a_factor_of_the_projector_is_measured(self, factor):
        verdict = compare(scaled(recorded(1), factor), recorded(2)).verdict
        assert verdict.explained[0].cause.name in ("projector power", "offset", "background")
        power = [each for each in verdict.explained if each.cause.name == "projector power"]
        ((_, value, sigma),) = parameters(power[0])
        assert abs(value - factor) < 4 * sigma + 0.01

    def test_an_offset_is_measured(self):
        verdict = compare(scaled(recorded(1), 1.0, added=1e5), recorded(2)).verdict
        assert named(verdict) == "offset"
        assert verdict.explained[0].theta[0] == pytest.approx(1e5, rel=0.2)

    def test_readings_that_differ_alone_are_the_worst(self):
        real = recorded(1)
        counts = real.buckets.counts.astype(np.float64)
        counts[:, 17] += 1e6 / real.buckets.electrons_per_count
        comparison = compare(
            replace(real, buckets=replace(real.buckets, counts=counts)), recorded(2)
        )
        assert comparison.worst[0][0].startswith("exposure 17,")
        assert comparison.verdict.rest < 1e-3

    def test_saturated_readings_do_not_count(self):
        real = recorded(1)
        counts, saturated = real.buckets.counts.copy(), real.buckets.saturated.copy()
        counts[:, 5], saturated[:, 5] = 0, True
        buckets = replace(real.buckets, counts=counts, saturated=saturated)
        comparison = compare(replace(real, buckets=buckets), recorded(2))
        assert np.isnan(comparison.z[5])
        assert named(comparison.verdict) == "equal"

    def test_all_saturated_is_refused(self):
        real = recorded(1)
        buckets = replace(real.buckets, saturated=np.ones_like(real.buckets.saturated))
        real = replace(real, buckets=buckets, spots=None)
        with pytest.raises(InputError, match="no reading"):
            compare(real, replace(recorded(2), spots=None))

    def test_noise_is_that_stated(self):
        comparison = compare(recorded(1), recorded(2))
        for term in comparison.noise:
            assert abs(term.ratio - 1) < 4 * term.sigma, term

    def test_more_noise_than_stated_is_measured(self):
        real = recorded(1)
        quiet = replace(real.buckets, noise_electrons=real.buckets.noise_electrons / 2)
        real = replace(real, buckets=quiet)
        means = patterns_mean(real), patterns_mean(recorded(2))
        first = noise_of({"real": real, "simulated": recorded(2)}, means, None)[0]
        assert first.ratio == pytest.approx(4, rel=0.3)

    @pytest.mark.parametrize("method", ["spad", "hybrid", "fog"])
    def test_every_kind_of_readings(self, method):
        comparison = compare(recorded(1, method), recorded(2, method))
        assert named(comparison.verdict) == "equal"
        assert [each.name for each in comparison.groups][:2] == ["patterns", "spot 0"]
        json.dumps(comparison.summary())

    def test_histograms_differ_as_their_variance_says(self):
        model = HistogramModel(recorded(1, "spad").spots, recorded(2, "spad").spots)
        one, other = (mean.value for mean in model.means)
        z = (one - other) / np.sqrt(model.variance)
        usable = z[model.usable]
        assert abs(np.mean(usable**2) - 1) < 4 * np.sqrt(2 / usable.size)


class TestUnknownNoise:
    def test_is_that_of_the_scatter(self):
        real = recorded(1)
        mean = patterns_mean(replace(real, buckets=replace(real.buckets, noise_electrons=np.nan)))
        ratio = mean.variance / patterns_mean(real).variance
        assert ratio.mean() == pytest.approx(1, abs=0.2)

    def test_of_one_frame_is_that_of_the_other_capture(self):
        real = recorded(1)
        one = replace(
            real,
            buckets=replace(between(real.buckets, 0, 1), noise_electrons=np.nan),
            spots=between(real.spots, 0, 1),
        )
        of_other = patterns_mean(recorded(2))
        np.testing.assert_allclose(common_noise(patterns_mean(one), of_other), of_other.variance)
        with pytest.raises(InputError, match="at least 4 frames"):
            compare(one, one)


class TestRefused:
    def test_other_patterns(self):
        plan = make_plan((64, 64), 127, polarity="single-ended", order="sequency")
        with pytest.raises(InputError, match=r"patterns: index of exposure \d+ is \d+ in REAL"):
            compare(recorded(1), replace(recorded(2), plan=plan))

    def test_other_numbers_of_patterns(self):
        with pytest.raises(InputError, match="number of exposures is 128 in REAL"):
            compare(recorded(1), first_patterns(recorded(2), 64))

    def test_missing_spots(self):
        with pytest.raises(InputError, match="REAL has no spots"):
            compare(replace(recorded(1), spots=None), recorded(2))

    def test_other_methods(self):
        with pytest.raises(InputError, match="spots: method is dtof in REAL, cw in SIMULATED"):
            compare(replace(recorded(1), spots=recorded(1, "spad").spots), recorded(2))

    def test_other_directions(self):
        spots = recorded(2).spots
        turned = replace(spots, directions=spots.directions[::-1])
        with pytest.raises(InputError, match="spots/directions: spot"):
            compare(recorded(1), replace(recorded(2), spots=turned))

    def test_other_exposures(self):
        buckets = recorded(2).buckets
        shorter = replace(buckets, exposure_time_s=buckets.exposure_time_s / 2)
        with pytest.raises(InputError, match="buckets/exposure_time_s"):
            compare(recorded(1), replace(recorded(2), buckets=shorter))

    def test_an_unknown_scale(self):
        with pytest.raises(InputError, match="REAL: buckets/electrons_per_count"):
            compare(with_readings(recorded(1), electrons_per_count=np.nan), recorded(2))

    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_readings_that_are_no_numbers(self, value):
        counts = recorded(1).buckets.counts.astype(np.float64)
        counts[1, 3] = value
        with pytest.raises(InputError, match="buckets/counts"):
            compare(with_readings(recorded(1), counts=counts), recorded(2))

    def test_a_flight(self):
        flight = replace(recorded(1), poses=Poses.none(FRAMES))
        with pytest.raises(InputError, match="REAL: a flight with poses"):
            compare(flight, recorded(2))

    def test_steered_spots(self):
        spots = recorded(2).spots
        steered = replace(spots, pointing=np.tile(spots.directions, (FRAMES, 1, 1)))
        with pytest.raises(InputError, match="SIMULATED: spots/pointing"):
            compare(recorded(1), replace(recorded(2), spots=steered))


class TestArrays:
    def image(self, seed: int, factor: float = 1.0, shift: int = 0) -> np.ndarray:
        rng = np.random.default_rng(seed)
        y, x = np.mgrid[:32, :32]
        scene = 100 * np.exp(-((x - 14 - shift) ** 2 + (y - 17) ** 2) / 60) + 20
        return factor * scene + rng.normal(size=scene.shape)

    def test_equal_images(self):
        assert named(compare_arrays(self.image(1), self.image(2)).verdict) == "equal"
        assert named(compare_arrays(self.image(1), self.image(1)).verdict) == "equal"

    def test_a_brighter_image(self):
        verdict = compare_arrays(self.image(1, 1.05), self.image(2)).verdict
        assert named(verdict) == "power"
        ((_, value, sigma),) = parameters(verdict.explained[0])
        assert abs(value - 1.05) < 4 * sigma

    def test_a_shifted_image(self):
        verdict = compare_arrays(self.image(1, shift=1), self.image(2)).verdict
        assert named(verdict) == "pointing"
        assert verdict.explained[0].theta[1] == pytest.approx(-1, abs=0.1)

    def histograms(self, seed: int, factor: float = 1.0, more: float = 0.0) -> np.ndarray:
        rng = np.random.default_rng(seed)
        bins = np.arange(128)
        mean = factor * 300 * np.exp(-((bins - 60) ** 2) / 20) + 3 + more
        return rng.poisson(np.tile(mean, (2, 1)))

    def test_histograms(self):
        one = self.histograms(1)
        assert named(compare_arrays(one, self.histograms(2)).verdict) == "equal"
        assert named(compare_arrays(one, self.histograms(2, 1.1)).verdict) == "power"
        assert named(compare_arrays(one, self.histograms(2, more=1.0)).verdict) == "background"

    def test_deviations_of_equal_histograms_are_normal(self):
        z = compare_arrays(self.histograms(1), self.histograms(2)).z
        assert kstest(z, "norm").pvalue > 1e-3

    def test_groups_of_bins_are_numbered_one_by_one(self):
        counts = np.array([MIN_COUNTS, 1, MIN_COUNTS - 1, 3 * MIN_COUNTS, 1.0])
        assert joined_bins(counts).tolist() == [0, 1, 1, 2, 2]

    def test_bad_arrays(self, tmp_path):
        with pytest.raises(InputError, match="the shape is"):
            compare_arrays(np.ones((8, 8)), np.ones((8, 9)))
        with pytest.raises(InputError, match="REAL has whole numbers"):
            compare_arrays(np.ones((8, 8), int), np.ones((8, 8)))
        with pytest.raises(InputError, match="must not be negative"):
            compare_arrays(-np.ones((2, 8), int), np.ones((2, 8), int))
        for array, words in ((np.full((8, 8), np.nan), "finite"), (np.ones(8), "shape")):
            np.save(tmp_path / "bad.npy", array)
            with pytest.raises(InputError, match=words):
                read_array(tmp_path / "bad.npy")

    def test_an_array_beside_a_capture(self, tmp_path):
        with pytest.raises(InputError, match="is an array"):
            compare_files(tmp_path / "a.npy", tmp_path / "b.h5")


class TestCommand:
    @pytest.fixture
    def run(self):
        words = [each.name for each in app.registered_commands]
        if "compare" not in words:
            app.command("compare")(compare_command.command)
        return lambda *given: CliRunner().invoke(app, ["compare", *map(str, given)])

    def test_page_and_json(self, run, tmp_path: Path):
        write_capture(scaled(recorded(1), 1.05), tmp_path / "real.h5")
        write_capture(recorded(2), tmp_path / "simulated.h5")
        page = tmp_path / "page.html"
        files = (tmp_path / "real.h5", tmp_path / "simulated.h5")
        result = run(*files, "--page", page, "--json")
        assert result.exit_code == 1, result.output
        report = json.loads(result.stdout)
        assert report["differ"]
        assert report["cause"] in ("projector power", "offset", "background")
        text = page.read_text(encoding="utf-8")
        assert "What explains it" in text
        assert "Real less simulated" in text

    def test_equal_captures_exit_0(self, run, tmp_path: Path):
        write_capture(recorded(1), tmp_path / "real.h5")
        result = run(tmp_path / "real.h5", tmp_path / "real.h5")
        assert result.exit_code == 0, result.output
        assert "Equal within the noise" in result.stdout

    def test_a_missing_file(self, run, tmp_path: Path):
        result = run(tmp_path / "none.h5", tmp_path / "none.h5")
        assert result.exit_code == 2


def test_tiny_probabilities_are_bounds():
    assert probability(1e-9) == "< 10⁻⁶"
    assert probability(0.25) == "0.25"
