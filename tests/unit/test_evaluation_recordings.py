"""A recording without truth tells its own noise, what is saturated, and how its ranges repeat."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from reconstruction import make_plan, write_capture
from reconstruction.capture.importers import (
    capture_from_readings,
    capture_from_spots,
    spots_from_histograms,
    spots_from_taps,
)
from reconstruction.evaluation import evaluate_recording
from reconstruction.operators import expose
from spisim_app.cli import app

FRAMES, SCALE, NOISE = 64, 2.0, 40.0
PLAN = make_plan((8, 8), polarity="differential")
IMAGE = 100 + 400 * np.outer(np.hanning(8), np.ones(8))


def counts(rng, electrons, noise=NOISE):
    return (rng.poisson(electrons) + rng.normal(0, noise, electrons.shape)) / SCALE


def recorded(frames=FRAMES, noise=NOISE):
    """A still scene, of which the capture states ``NOISE``."""
    rng = np.random.default_rng(1)
    light = np.tile(expose(PLAN, IMAGE), (frames, 1))
    phase = 4 * np.pi * 20e6 / 299792458 * np.array([1.0, 2, 3, 4])[:, None]
    taps = 9000 + 4000 * np.cos(phase - np.arange(4) * np.pi / 2)
    given = {"electrons_per_count": SCALE, "noise_electrons": NOISE}
    spots = spots_from_taps(counts(rng, np.tile(taps, (frames, 1, 1)), noise), 20e6, about=given)
    return capture_from_readings(counts(rng, light, noise), PLAN, [0], given, spots=spots)


def test_noise_as_stated_has_the_ratio_of_one():
    reported = evaluate_recording(recorded())
    assert reported["frames"] == FRAMES
    expected = np.sqrt(expose(PLAN, IMAGE)[1:].mean() + NOISE**2)
    assert reported["readings"]["expected"] == pytest.approx(expected, rel=0.01)
    assert reported["readings"]["noise_ratio"] == pytest.approx(1, abs=0.03)
    assert reported["readings"]["saturated"] == pytest.approx(1 / PLAN.exposures)
    assert reported["taps"]["unit"] == "electron"
    assert reported["taps"]["noise_ratio"] == pytest.approx(1, abs=0.1)
    assert reported["image"]["signal_over_noise"] > 1
    for true_m, spot in zip([1, 2, 3, 4], reported["spots"]["cw"], strict=True):
        assert spot["range_m"] == pytest.approx(true_m, abs=0.02)
        assert spot["spread_ratio"] == pytest.approx(1, abs=0.35)
        assert spot["ranged"] == 1


def test_more_noise_than_stated_shows():
    reported = evaluate_recording(recorded(noise=4 * NOISE))
    light = expose(PLAN, IMAGE)[1:].mean()
    ratio = np.sqrt((light + 16 * NOISE**2) / (light + NOISE**2))
    assert reported["readings"]["noise_ratio"] == pytest.approx(ratio, rel=0.03)
    assert reported["spots"]["cw"][0]["spread_ratio"] > 1.3


def test_of_one_frame_nothing_is_measured():
    reported = evaluate_recording(recorded(frames=1))
    assert reported["readings"]["noise"] is None
    assert reported["spots"]["cw"][0]["spread_m"] is None
    assert reported["spots"]["cw"][0]["sigma_m"] > 0


def test_ranges_alone_and_histograms():
    rng = np.random.default_rng(0)
    arrivals = [rng.normal(20e-9, 1e-9, (8, 500)), rng.uniform(0, 50e-9, (8, 40))]
    edges = np.linspace(0, 50e-9, 51)
    one = [np.histogram(np.concatenate(each), edges)[0] for each in zip(*arrivals, strict=True)]
    spots = spots_from_histograms(np.repeat(np.array(one)[:, None], 4, axis=1), 1e-9, 10**6)
    reported = evaluate_recording(capture_from_spots(spots))
    assert reported["readings"] is None
    assert reported["image"] is None
    assert reported["taps"]["noise_ratio"] == pytest.approx(1, abs=0.3)
    assert reported["spots"]["dtof"][0]["range_m"] == pytest.approx(3, abs=0.02)


def test_the_command_tells_it_instead_of_refusing(tmp_path):
    write_capture(recorded(frames=8), tmp_path / "rig.h5")
    done = CliRunner().invoke(app, ["evaluate", str(tmp_path / "rig.h5")])
    assert done.exit_code == 0, done.output
    for words in ("saturated", "expected", "spread", "of 8 frames"):
        assert words in done.stdout
    done = CliRunner().invoke(app, ["evaluate", str(tmp_path / "rig.h5"), "--json"])
    assert json.loads(done.stdout)["frames"] == 8
