"""Fits to recordings: estimates, and the files and words that state them."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import spisim
from reconstruction import InputError, write_capture
from spisim.base.config import dump_yaml, parse_model
from spisim.instrument import Instrument
from spisim.scene.load import make_scene
from spisim_app.cli import app
from spisim_inverse.fit import written
from spisim_inverse.fit.priors import Prior, parsed_priors, parsed_starts, read_priors
from spisim_inverse.fit.result import in_words
from spisim_inverse.fit.twin import Scale, Twin
from twoboards import (
    BOARD,
    DARK,
    FRAMES,
    GAIN,
    LASER,
    OFFSET,
    POWER,
    VISIBILITY,
    boards,
    fitted,
    instrument_of,
    recorded,
)


class TestEstimates:
    def test_visibility_reflectance_and_gain_from_far_starts(self):
        capture = recorded()
        gain = capture.buckets.electrons_per_count
        result = fitted({VISIBILITY: 180.0, BOARD: 0.15, GAIN: 3 * gain})
        truth = np.log([60.0, 0.4, gain])
        z = (result.coordinates - truth) / np.sqrt(np.diag(result.covariance))
        assert np.abs(z).max() < 4
        assert result.fits
        assert (np.diag(result.bound) <= np.diag(result.covariance) * (1 + 1e-6)).all()
        assert np.abs(np.diag(result.correlation) - 1).max() < 1e-9

    def test_equal_seeds_give_equal_results(self):
        one, other = (fitted({BOARD: 0.3}).coordinates for _ in range(2))
        assert (one == other).all()

    def test_a_rig_is_calibrated_by_a_flat_board(self):
        own = instrument_of(lasers={"power_w": 6e-3})
        factors = np.exp(0.1 * np.random.default_rng(1).standard_normal(15))
        factors /= factors.mean()
        fields = yaml.safe_load(own.text)
        fields["plan"]["throughput"] = {"factors": factors.tolist()}
        fields["detector"]["adc"]["offset_counts"] = 400
        rig = parse_model(dump_yaml(fields), Instrument, "rig")
        capture = spisim.simulate(boards(None), rig, spp=256, seed=8, frames=FRAMES).capture
        stated = replace(capture.buckets, offset_counts=256.0)
        free = dict.fromkeys([DARK, GAIN, LASER, OFFSET, "throughput"])
        result = fitted(
            free, replace(capture, buckets=stated), scene=boards(None), spp=256,
        )  # fmt: skip
        values = {each.name: each for each in result.estimates}
        truth = {DARK: 400.0, LASER: 6e-3, OFFSET: 0.0, GAIN: capture.buckets.electrons_per_count}
        for name, value in truth.items():
            assert abs(values[name].value - value) < 4 * values[name].sigma
        for row, factor in zip(rig.pattern_plan.distinct.tolist(), factors, strict=True):
            each = values[f"throughput[{row}]"]
            assert abs(each.value - factor) < 4.5 * each.sigma
        assert "throughput of 15 patterns" in "\n".join(in_words(result))

    def test_a_prior_holds_what_the_recording_does_not_determine(self):
        free = {POWER: None, BOARD: None, GAIN: None, DARK: None}
        clear = recorded(None)
        with pytest.raises(
            InputError, match=rf"does not determine .*{POWER} .*{GAIN}.*condition number"
        ):
            fitted(free, clear, scene=boards(None))
        power = spisim.load_instrument("paper").imaging.projector.power_w
        result = fitted(free, clear, scene=boards(None), priors={POWER: Prior(power, 0.05 * power)})
        sigma = result.estimates[0].sigma / power
        assert sigma == pytest.approx(0.05, rel=0.05)


class TestText:
    def test_starts(self):
        assert parsed_starts(["a=2", "b, c = 3"]) == {"a": 2.0, "b": None, "c": 3.0}
        with pytest.raises(InputError, match="twice"):
            parsed_starts(["a,a"])
        with pytest.raises(InputError, match="'x' is not a number"):
            parsed_starts(["a=x"])

    def test_priors(self, tmp_path):
        assert parsed_priors(["a=2±0.5", "b = 3 +- 1"]) == {"a": Prior(2, 0.5), "b": Prior(3, 1)}
        with pytest.raises(InputError, match="must be NAME=MEAN±SIGMA"):
            parsed_priors(["a=2"])
        with pytest.raises(InputError, match="'x' is not a number"):
            parsed_priors(["a=2±x"])
        path = tmp_path / "priors.yaml"
        path.write_text("a: 2±0.5\n")
        assert read_priors(path) == {"a": Prior(2, 0.5)}
        path.write_text("- a\n")
        with pytest.raises(InputError, match=r"priors.yaml: must be a mapping"):
            read_priors(path)


class TestFiles:
    def test_fitted_scene_and_instrument_load_again(self, tmp_path):
        free = {VISIBILITY: None, BOARD: None, GAIN: None, LASER: None}
        result = fitted(free)
        scene, instrument = tmp_path / "scene.yaml", tmp_path / "instrument.yaml"
        written.write_fitted(result, scene, instrument, tmp_path)
        loaded = spisim.load_scene(scene)
        values = {each.name: each.value for each in result.estimates}
        assert loaded.atmosphere.visibility_m == pytest.approx(values[VISIBILITY])
        board = next(each.material for each in loaded.objects if each.material.name == "board")
        assert board.reflectance == pytest.approx(values[BOARD])
        rig = spisim.load_instrument(instrument)
        assert rig.lasers.power_w == pytest.approx(values[LASER])
        assert rig.detector.adc.electrons_per_count == pytest.approx(values[GAIN])

    def test_a_shipped_material_becomes_one_of_the_scene(self):
        scene = spisim.load_scene("target-step-wedge")
        capture = spisim.simulate(scene, instrument_of(), spp=8, frames=2).capture
        result = fitted({"materials.cardboard": 0.3}, capture, scene=scene)
        fields = yaml.safe_load(written.scene_text(result, spisim.scene.scenes_folder()))
        again = make_scene(dump_yaml(fields), spisim.scene.scenes_folder(), "again")
        value = result.estimates[0].value
        own = next(each for each in again.objects if each.material.name == "cardboard")
        assert own.material.reflectance == pytest.approx(value)

    @pytest.fixture
    def files(self, tmp_path):
        write_capture(recorded(), tmp_path / "recorded.h5")
        (tmp_path / "scene.yaml").write_text(boards().text)
        return tmp_path

    def run(self, folder: Path, *more: str):
        given = ["recorded.h5", "--scene", "scene.yaml", "--spp", "32"]
        given = [str(folder / each) if each.endswith((".h5", ".yaml")) else each for each in given]
        return CliRunner().invoke(app, ["fit", *given, *more])

    def test_command_writes_page_and_files(self, files):
        page, scene = files / "fit.html", files / "fitted.yaml"
        result = self.run(
            files, "--free", f"{BOARD}=0.2", "--prior", f"{BOARD}=0.4±0.2", "--page", str(page),
            "-o", str(scene), "--json",
        )  # fmt: skip
        assert result.exit_code == 0, result.output
        report = json.loads(result.stdout)
        assert report["estimates"][0]["value"] == pytest.approx(0.4, rel=0.05)
        assert report["written"] == [str(scene), str(page)]
        text = page.read_text()
        assert "materials.board" in text
        assert "0.4 ± 0.2" in text
        assert spisim.load_scene(scene).name == "boards"

    def test_command_begins_in_the_weather_that_it_names(self, files):
        (files / "scene.yaml").write_text(boards(None).text)
        scene = files / "fitted.yaml"
        result = self.run(files, "--visibility", "150", "--free", VISIBILITY, "-o", str(scene))
        assert result.exit_code == 0, result.output
        assert spisim.load_scene(scene).atmosphere.visibility_m == pytest.approx(60, rel=0.05)

    def test_command_refuses_to_overwrite_what_it_did_not_write(self, files):
        result = self.run(files, "--free", BOARD, "-o", str(files / "scene.yaml"))
        assert result.exit_code == 2

    def test_command_names_the_capture_in_errors(self, files):
        result = self.run(files, "--free", "materials.bord")
        assert result.exit_code == 2
        assert "recorded.h5" in result.output
        assert "did you mean" in result.output


def test_scales_are_written_into_their_own_detectors():
    twin = Twin(boards(), spisim.load_instrument("paper"), Scale(3.0, 7.4), Scale(5.0, -2.0))
    made = yaml.safe_load(written.instrument_text(SimpleNamespace(twin=twin)))
    for detector, scale, offset in ((made["detector"], 3, 7), (made["tof"]["detector"], 5, 0)):
        assert detector["adc"]["full_scale_electrons"] == scale * 2 ** detector["adc"]["bits"]
        assert detector["adc"]["offset_counts"] == offset
    spots = replace(twin, buckets=None)
    made = yaml.safe_load(written.instrument_text(SimpleNamespace(twin=spots)))
    assert made["detector"] == yaml.safe_load(twin.instrument.text)["detector"]
