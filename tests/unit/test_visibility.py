"""Visibility of a posterior of the fog, of drawn readings, of many frames, and in files."""

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from typer.testing import CliRunner

from fogs import light
from hdf5files import changed
from reconstruction import read_result, reconstruct, write_capture
from reconstruction.base.errors import InputError
from reconstruction.capture import Spots
from reconstruction.capture.importers import capture_from_spots
from reconstruction.capture.schema import between
from reconstruction.cli import main
from reconstruction.evaluation import evaluate_recording
from reconstruction.exports.shot import Shot
from reconstruction.outputs.result_file import result_bytes
from reconstruction.ranging import Ranges, Visibility, pooled, ranging_method
from reconstruction.ranging.fog.fog_state import FogState
from reconstruction.ranging.fog.fog_visibility import visibility_of
from reconstruction.ranging.fog.templates import EXTINCTIONS_PER_M
from spisim.atmosphere import FOGS, GammaSizes, fog
from spisim.atmosphere.visibility import extinction_at_550nm
from spisim.instrument import Instrument, load_instrument
from spisim_app.cli import app
from spisim_app.report.capture import write_report
from spisim_live.results import Outcome
from spisim_live.ros.messages import ranging_status
from spisim_live.sinks.lines import result_report

KOSCHMIEDER = math.log(50)  # extinction times visibility, for a contrast of 2 %
RATIO = 1.07  # of the extinctions at 1550 and 550 nm
RANGES = np.array([4.2, 5.5, 6.5, 8.0])
STATED = Visibility(53.2, 0.21, 37.0)
CLEAR_AIR = Visibility(math.nan, math.nan, 300.0)


@cache
def instrument(name: str = "fog") -> Instrument:
    return load_instrument(name)


def record(visibility_m: float | None, name: str = "fog", seed: int = 1, **scene) -> Spots:
    extinction = 0.0 if visibility_m is None else RATIO * KOSCHMIEDER / visibility_m
    received = light(instrument(name), RANGES, extinction_per_m=extinction, **scene)
    rng = np.random.default_rng(seed)
    return instrument(name).tof.record(received, instrument(name).spot_optics, rng)


def measure(spots: Spots, method: str = "fog") -> list[Ranges]:
    solve = ranging_method(method, spots).compile(between(spots, 0, 0))
    return [solve(between(spots, k, k + 1)) for k in range(len(spots.readings))]


# From the posterior


def known_fog(
    extinction: float, log_sigma: float, backscatter: float, backscatter_log_sigma: float = 1e-3
) -> FogState:
    """Posterior by ranging's prior of readings that show both within their sigmas."""
    away = np.log(EXTINCTIONS_PER_M / extinction) / log_sigma
    expected = np.log(0.035 * EXTINCTIONS_PER_M)
    ratio = (math.log(backscatter) - expected) / math.hypot(0.6, backscatter_log_sigma)
    probability = np.exp(-(away**2) / 2 - ratio**2 / 2)
    prior, read = 0.6**-2, backscatter_log_sigma**-2
    median = (prior * expected + read * math.log(backscatter)) / (prior + read)
    sigma = np.full(median.size, (prior + read) ** -0.5)
    return FogState(probability / probability.sum(), median, sigma)


@pytest.mark.parametrize("extinction", [0.03, 0.05, 0.083, 0.1, 0.13])
@pytest.mark.parametrize("backscatter_per_sr", [0.044, 0.05])
@pytest.mark.parametrize("backscatter_log_sigma", [1e-3, 0.2])
def test_extinction_and_backscattering_give_the_visibility(
    extinction, backscatter_per_sr, backscatter_log_sigma
):
    state = known_fog(extinction, 0.15, backscatter_per_sr * extinction, backscatter_log_sigma)
    precisions = 0.15**-2, 1 / (0.18**2 + backscatter_log_sigma**2)
    off = math.log(backscatter_per_sr / 0.044) * precisions[1] / sum(precisions)
    result = visibility_of(state, EXTINCTIONS_PER_M)
    true_m = RATIO * KOSCHMIEDER / (extinction * math.exp(off))
    assert result.visibility_m == pytest.approx(true_m, rel=0.02)
    sigma = math.hypot(sum(precisions) ** -0.5, 0.03)
    assert result.log_sigma == pytest.approx(sigma, rel=0.1)
    assert result.at_least_m == pytest.approx(true_m * math.exp(-1.645 * sigma), rel=0.05)


def test_the_sigma_does_not_depend_on_where_between_the_extinctions_it_is():
    extinctions = np.geomspace(0.045, 0.15, 30)
    sigmas = [
        visibility_of(known_fog(each, 0.15, 0.044 * each), EXTINCTIONS_PER_M).log_sigma
        for each in extinctions
    ]
    assert max(sigmas) < 1.15 * min(sigmas)


def test_without_readings_there_is_a_bound_alone():
    prior = FogState(np.full(9, 1 / 9), np.log(0.035 * EXTINCTIONS_PER_M), np.full(9, 0.6))
    result = visibility_of(prior, EXTINCTIONS_PER_M)
    assert np.isnan(result.visibility_m)
    assert 5 < result.at_least_m < 20


def test_the_constants_are_those_of_mie_theory():
    """Of droplets of other sizes than those that the constants were chosen by."""
    ratios, backscatter = [], []
    for kind, particles in FOGS.items():
        if isinstance(particles.sizes, GammaSizes) and particles.sizes.mode_radius_um >= 2:
            medium = fog(
                50.0,
                kind,
            )
            ratios.append(medium.extinction_per_m / extinction_at_550nm(50.0))
            straight_back = -np.cos(np.linspace(0, 0.02, 5))
            backscatter.append(medium.albedo * medium.phase.density(straight_back).mean())
    assert len(ratios) == 4
    assert np.log(ratios).mean() == pytest.approx(math.log(RATIO), abs=0.03)
    assert np.log(backscatter).mean() == pytest.approx(math.log(0.044), abs=0.18)
    assert np.log(backscatter).std() == pytest.approx(0.18, abs=0.06)


# From readings


def test_visibilities_scatter_about_the_truth_as_sigma_says():
    rng = np.random.default_rng(5)
    errors, sigmas, bounded = [], [], []
    for seed in range(60):
        true_m = float(np.exp(rng.uniform(np.log(20), np.log(120))))
        droplets = 0.044 * math.exp(0.18 * rng.standard_normal())
        spots = record(
            true_m * math.exp(0.03 * rng.standard_normal()),
            seed=seed,
            backscatter_per_sr=droplets,
            reflectances=rng.uniform(0.1, 0.8, 4),
        )
        result = measure(spots)[0].visibility
        errors.append(math.log(result.visibility_m / true_m))
        sigmas.append(result.log_sigma)
        bounded.append(result.at_least_m < true_m)
    z = np.array(errors) / sigmas
    assert abs(z.mean()) < 4 / math.sqrt(z.size)
    # What fog may deviate from being even is part of sigma, and is not of these readings.
    assert 1 - 0.6 < (z**2).mean() < 1 + 4 * math.sqrt(2 / z.size)
    assert np.mean(bounded) > 0.88
    assert max(sigmas) < 0.4


@pytest.mark.parametrize("name", ["fog", "fog-spad"])
def test_clear_air_gives_a_lower_bound_only(name):
    steady = 2e4 if name == "fog-spad" else 1e8
    spots = record(None, name, frames=5, steady_per_s=steady)
    for each in measure(spots):
        assert np.isnan(each.visibility.visibility_m)
        assert np.isnan(each.visibility.log_sigma)
        assert 200 < each.visibility.at_least_m < 1000
        assert str(each.visibility).startswith("at least ")


def test_thicker_fog_has_the_smaller_visibility():
    estimates = [measure(record(each))[0].visibility.visibility_m for each in (25, 50, 100)]
    assert estimates == sorted(estimates)


def test_plain_methods_unscaled_light_and_two_readings_have_none():
    spots = record(50.0)
    assert measure(spots)[0].visibility is not None
    assert measure(spots, "cw")[0].visibility is None
    unscaled = replace(spots, electrons_per_joule=math.nan)
    assert measure(unscaled)[0].visibility is None
    assert measure(record(50.0, "paper"))[0].visibility is None
    with pytest.raises(InputError, match="aperture"):
        measure(replace(spots, aperture_radii_m=np.full(4, np.nan)))


# Of frames together


def test_noise_averages_out_and_the_droplets_do_not():
    one = Visibility(50.0, 0.20, 36.0)
    many = pooled([one] * 100)
    assert many.visibility_m == pytest.approx(50)
    assert 0.17 < many.log_sigma < one.log_sigma
    sharp = pooled([Visibility(50.0, 0.1, 42.0)] * 100)
    assert 0.05 < sharp.log_sigma < 0.09
    assert sharp.at_least_m == pytest.approx(50 * math.exp(-1.645 * sharp.log_sigma), rel=1e-3)


def test_of_one_frame_it_is_that_frame():
    for sigma in (0.08, 0.15, 0.3):
        one = Visibility(50.0, sigma, 50 * math.exp(-1.645 * sigma))
        assert pooled([one]) == pytest.approx(one, rel=0.02)


def test_frames_count_by_their_inverse_variance():
    frames = [Visibility(40.0, 0.1, 1.0), Visibility(80.0, 0.2, 1.0)]
    assert pooled(frames).visibility_m == pytest.approx(40 * 2**0.2)


def test_pooled_frames_are_as_sure_as_they_are_right():
    """The droplets' ratio is drawn once for a scene, the readings' noise for each frame."""
    rng = np.random.default_rng(3)
    z = []
    for _ in range(400):
        droplets = 0.18 * rng.standard_normal()
        common = math.hypot(0.03, 0.05) * rng.standard_normal()
        of_readings = 0.15 * rng.standard_normal(20)
        precisions = 0.15**-2, 0.18**-2
        log_m = (precisions[0] * of_readings + precisions[1] * droplets) / sum(precisions)
        sigma = math.hypot(sum(precisions) ** -0.5, 0.03)
        result = pooled(Visibility(50 * math.exp(each + common), sigma, 1.0) for each in log_m)
        z.append(math.log(result.visibility_m / 50) / result.log_sigma)
    assert np.mean(np.square(z)) == pytest.approx(1, abs=4 * math.sqrt(2 / 400))


def test_frames_without_visibility_are_left_out():
    assert pooled([]) is None
    assert pooled([None, None]) is None
    assert pooled([None, STATED, CLEAR_AIR]).visibility_m == pytest.approx(STATED.visibility_m)
    thin = pooled([STATED, CLEAR_AIR, CLEAR_AIR])
    assert np.isnan(thin.visibility_m)
    assert thin.at_least_m == 300


# In results


@pytest.fixture
def result(capture):
    result = reconstruct(capture)
    (name, ranges), *others = result.rangings.items()
    return replace(result, rangings={name: replace(ranges, visibility=STATED), **dict(others)})


@pytest.mark.parametrize("stated", [STATED, CLEAR_AIR])
def test_the_result_file_keeps_it(result, tmp_path, stated):
    name, ranges = next(iter(result.rangings.items()))
    result = replace(result, rangings={name: replace(ranges, visibility=stated)})
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(result))
    np.testing.assert_array_equal(read_result(path).visibility, stated)
    assert read_result(path).visibility == pytest.approx(stated, nan_ok=True)


def test_files_of_earlier_versions_have_none(result, tmp_path):
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(result))
    with changed(path) as content:
        content.attrs["version"] = "3.8"
        del content[f"rangings/{next(iter(result.rangings))}/visibility"]
    assert read_result(path).visibility is None


def test_a_part_that_is_missing_is_named(result, tmp_path):
    path = tmp_path / "result.h5"
    path.write_bytes(result_bytes(result))
    with changed(path) as content:
        del content[f"rangings/{next(iter(result.rangings))}/visibility/log_sigma"]
    with pytest.raises(InputError, match="visibility/log_sigma"):
        read_result(path)


def test_it_is_shown(result, capture):
    assert "53.2 m ± 21 %" in repr(result)
    values = {each["key"]: each["value"] for each in _diagnostics(result, capture)}
    assert values["visibility: visibility_m"] == "53.2"
    assert STATED.numbers == STATED._asdict()
    assert CLEAR_AIR.numbers == {"visibility_m": None, "log_sigma": None, "at_least_m": 300.0}


def test_pages_and_live_lines_hold_it(result, capture, tmp_path):
    write_report(tmp_path / "report.html", capture, result)
    assert "53.2 m ± 21 %" in (tmp_path / "report.html").read_text(encoding="utf-8")
    line = result_report(Outcome(None, result, 0, 0.1))
    assert line["visibility"] == STATED.numbers
    others = {name: replace(each, visibility=None) for name, each in result.rangings.items()}
    assert "visibility" not in result_report(Outcome(None, replace(result, rangings=others), 0, 0))


def test_the_command_reports_it_and_a_recording_pools_it(tmp_path, capsys):
    capture = capture_from_spots(record(50.0, frames=4))
    path = tmp_path / "fog.h5"
    write_capture(capture, path)
    arguments = [str(path), "-o", str(tmp_path / "out")]
    assert main([*arguments, "--json"]) == 0
    reported = json.loads(capsys.readouterr().out)["visibility"]
    assert reported == pytest.approx(read_result(tmp_path / "out/result.h5").visibility._asdict())
    assert main(arguments) == 0
    assert f"visibility (2 % contrast): {Visibility(**reported)}" in capsys.readouterr().out
    frames = [each.visibility for each in measure(record(50.0, frames=4))]
    assert evaluate_recording(capture)["visibility"] == pytest.approx(pooled(frames).numbers)
    done = CliRunner().invoke(app, ["evaluate", str(path)])
    assert f"visibility (2 % contrast): {pooled(frames).visibility_m:.3g} m" in done.output


def _diagnostics(result, capture):
    return ranging_status(Shot.of(result, capture.setup, 0))["values"]
