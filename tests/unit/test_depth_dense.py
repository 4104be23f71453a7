"""A range of every pixel from time of flight of every pattern: exact where it can be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.constants import c
from scipy.stats import binomtest

from densescene import CONTRAST, OPTICS, SHAPE, make_capture, record, scene
from reconstruction import (
    PatternPlan,
    capture_warnings,
    evaluate,
    first_patterns,
    make_plan,
    read_result,
    write_capture,
    write_outputs,
)
from reconstruction import reconstruct as run
from reconstruction.capture import Frames, Setup
from reconstruction.cli import main
from reconstruction.depth import Context, View, depth_method, range_over_depth
from reconstruction.depth.methods.dense import phasor_image, phasors
from reconstruction.image import Coefficients, Imaging
from reconstruction.operators import fwht

LIGHT, RANGE_M = scene()
LIT = LIGHT > 0


def dense_range(readings, plan):
    """Range of every pixel along its ray; the method looks at nothing but these readings."""
    setup = Setup(plan, OPTICS, None, None, readings)
    solve = depth_method("dense", setup).compile(Context(setup, Imaging(plan)))
    result = solve(View(None, None, Frames(0, None, None, readings)))
    return result.depth_m * range_over_depth(OPTICS, SHAPE)


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
@pytest.mark.parametrize("frequencies", [(15e6,), (30e6, 40e6)])
def test_all_patterns_without_noise_give_every_lit_pixel_exactly(polarity, frequencies):
    plan = make_plan(SHAPE, polarity=polarity)
    result = dense_range(record(LIGHT, RANGE_M, plan, frequencies), plan)
    assert np.isnan(result[~LIT]).all()
    np.testing.assert_allclose(result[LIT], RANGE_M[LIT], rtol=1e-6)


@pytest.mark.parametrize("frequencies", [(15e6,), (30e6, 40e6)])
def test_a_quarter_of_the_patterns_shows_the_room(frequencies):
    plan = make_plan(SHAPE, 256)
    result = dense_range(record(LIGHT, RANGE_M, plan, frequencies), plan)
    seen = np.isfinite(result)
    assert seen[LIT].mean() > 0.7
    assert seen[~LIT].mean() < 0.1
    error = (result - RANGE_M)[seen & LIT]
    assert np.mean(error**2) < 0.25 * RANGE_M[seen & LIT].var()


def test_phasors_scatter_as_their_variance_says():
    plan = make_plan(SHAPE)
    model = {"noise_electrons": 400.0}
    clean, _ = phasors(record(LIGHT, RANGE_M, plan, **model), 15e6)
    noisy = record(LIGHT, RANGE_M, plan, rng=np.random.default_rng(0), **model)
    result, variance = phasors(noisy, 15e6)
    ratio = np.abs(result - clean) ** 2 / variance  # exponential, of mean and deviation 1
    assert abs(ratio.mean() - 1) * np.sqrt(ratio.size) < 3.5


def test_the_error_of_a_pixel_is_that_of_its_coefficients():
    """White noise on an image whose own coefficients are far above it: nothing is suppressed."""
    rng = np.random.default_rng(1)
    image = rng.normal(0, 100, SHAPE) + 1j * rng.normal(0, 100, SHAPE)
    noise = rng.normal(0, 1, (1024, 2)) @ [1, 1j]
    plan = make_plan(SHAPE, order="natural", polarity="signed")
    coefficients = Coefficients(fwht(image.ravel()) + noise, np.full(1024, np.sqrt(2)))
    result, error = phasor_image(everything(plan), coefficients)
    assert np.allclose(error, np.sqrt(2 / 1024), rtol=1e-3)
    squares = np.abs(result - image) ** 2 / error**2
    assert abs(squares.mean() - 1) * np.sqrt(1024) < 3.5


@pytest.mark.parametrize("patterns", [64, 256, 512])
def test_the_error_is_large_where_the_image_is_guessed(patterns):
    truth = phasor_image(*decode_all(make_plan(SHAPE)))[0]
    image, error = phasor_image(*decode_all(make_plan(SHAPE, patterns)))
    actual = np.abs(image - truth)
    assert 0.67 < np.sqrt(np.mean(actual**2) / np.mean(error**2)) < 1.5
    large = error > np.median(error)
    assert np.mean(actual[large] ** 2) > 2 * np.mean(actual[~large] ** 2)


def everything(plan):
    return Imaging(plan).of(np.ones(plan.exposures, dtype=bool))


def decode_all(plan):
    usable = everything(plan)
    return usable, usable.decode(*phasors(record(LIGHT, RANGE_M, plan), 15e6))


def test_noise_takes_the_dark_pixels_first_and_hardly_any_false_ones_are_left():
    plan = make_plan(SHAPE)
    rng = np.random.default_rng(2)
    result = dense_range(record(LIGHT, RANGE_M, plan, rng=rng, noise_electrons=2e4), plan)
    seen = np.isfinite(result)
    false = int(seen[~LIT].sum())
    assert binomtest(false, int((~LIT).sum()), np.exp(-4.5), alternative="greater").pvalue > 1e-3
    missing = LIT & ~seen
    assert LIGHT[missing].mean() < LIGHT[seen].mean()


def test_pixel_ranges_scatter_as_phase_noise_says():
    """Full basis, noise small against every pixel: sigma = c / (4 pi f) * sigma_q / A."""
    light = np.full(SHAPE, 5e3)
    plan = make_plan(SHAPE)
    rng = np.random.default_rng(3)
    readings = record(light, RANGE_M, plan, rng=rng)
    result = dense_range(readings, plan)
    noise = everything(plan).decode(*phasors(readings, 15e6)).noise.mean()
    sigma = c / (4 * np.pi * 15e6) * noise / np.sqrt(2 * 1024) / (CONTRAST * light)
    ratio = np.std(result - RANGE_M) / sigma.mean()
    # The baseline makes dr/dL differ from 1/2 by less than a hundredth of this.
    assert abs(ratio**2 - 1) / np.sqrt(2 / 1023) < 3.5


@pytest.mark.parametrize("reason", ["not shown", "saturated"])
def test_without_the_level_there_is_no_map_and_it_says_so(reason):
    capture = make_capture()
    plan, readings = capture.plan, capture.pattern_taps
    if reason == "saturated":
        readings.saturated[0, np.flatnonzero(plan.index == 0)[0], 2] = True
    else:
        keep = plan.index != 0
        capture = replace(
            capture,
            plan=PatternPlan(SHAPE, plan.index[keep], plan.polarity[keep]),
            buckets=replace(
                capture.buckets,
                counts=capture.buckets.counts[:, keep],
                saturated=capture.buckets.saturated[:, keep],
            ),
            pattern_taps=replace(
                readings, taps=readings.taps[:, keep], saturated=readings.saturated[:, keep]
            ),
        )
    result = run(capture)
    assert result.depth_m is result.range_m is None
    assert not result.depths
    assert any("pattern 0" in line for line in capture_warnings(capture))


def test_saturated_taps_are_left_out_and_told():
    capture = make_capture()
    capture.pattern_taps.saturated[0, 100, 3] = True
    capture.pattern_taps.taps[0, 100, 3] = 1e9
    error = run(capture).range_m - RANGE_M
    assert np.abs(error[LIT]).max() < 0.1
    (warning,) = capture_warnings(capture)
    assert "the taps of 1 of 2048 exposures (0.0488 %)" in warning


def test_unknown_optics_are_told():
    capture = replace(make_capture(), optics=None)
    assert run(capture).range_m is None
    assert capture_warnings(capture) == ["the optics are unknown: there are no dense ranges"]


def test_the_pipeline_has_map_and_metrics():
    capture = make_capture()
    result = run(capture)
    assert result.depths.keys() == {"dense"}
    true_m = capture.truth.at(0).depth_m
    np.testing.assert_allclose(result.depths["dense"][LIT], true_m[LIT], rtol=1e-5)
    metrics = evaluate(result, capture)["depths"]
    assert metrics.keys() == {"dense"}
    assert metrics["dense"]["coverage"] == pytest.approx(0.75)
    assert metrics["dense"]["mae_m"] < 1e-4


def test_fewer_patterns_keep_their_taps():
    few = first_patterns(make_capture(), 256)
    assert few.pattern_taps.taps.shape == (1, 512, 4)
    expected = run(make_capture(256))
    np.testing.assert_array_equal(run(few).range_m, expected.range_m)


def test_a_detector_in_front_of_the_scene_gives_no_range():
    plan = make_plan(SHAPE)
    readings = replace(record(LIGHT, RANGE_M, plan), detector_position_m=np.array([0, 0, 30.0]))
    assert np.isnan(dense_range(readings, plan)).all()


def test_darkness_has_no_range():
    plan = make_plan(SHAPE, 100)
    readings = record(np.zeros(SHAPE), RANGE_M, plan)
    for taps in (readings.taps, np.full_like(readings.taps, readings.offset_counts)):
        assert np.isnan(dense_range(replace(readings, taps=taps), plan)).all()


def test_the_command_writes_map_and_picture_and_says_how_much_it_covers(tmp_path, capsys):
    write_capture(make_capture(), tmp_path / "capture.h5")
    assert main([str(tmp_path / "capture.h5"), "-o", str(tmp_path / "out")]) == 0
    assert "75.0 % of all pixels" in capsys.readouterr().out
    images = {"image.png", "image_pursuit.png", "image_zero_filled.png"}
    names = images | {"depth.png", "depth-deviation.png", "cloud.ply", "result.h5"}
    assert {file.name for file in (tmp_path / "out").iterdir()} == names
    copy, result = read_result(tmp_path / "out" / "result.h5"), run(make_capture())
    np.testing.assert_array_equal(copy.depths["dense"], result.depths["dense"])
    np.testing.assert_array_equal(copy.range_m, result.range_m)


def test_a_picture_of_an_earlier_result_does_not_stay(tmp_path):
    capture = make_capture(64)
    write_outputs(run(capture), capture, tmp_path)
    assert (tmp_path / "depth.png").exists()
    without = replace(capture, pattern_taps=None)
    write_outputs(run(without), without, tmp_path)
    assert not (tmp_path / "depth.png").exists()
