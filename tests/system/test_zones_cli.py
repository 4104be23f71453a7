"""Zone sensors from the command line: budget, simulation, reconstruction, page and evaluation."""

import json
from pathlib import Path

import numpy as np
import pytest

from commands import mistake, spisim
from reconstruction import read_capture, reconstruct
from spisim.instrument.model import PRESETS


def succeeded(*arguments: str | Path) -> str:
    run = spisim(*arguments)
    assert run.exit_code == 0, run.stderr
    return str(run.stdout)


def test_a_zone_sensor_is_simulated_and_reconstructed(tmp_path: Path) -> None:
    file, folder = tmp_path / "zones.h5", tmp_path / "out"
    succeeded("simulate", "target-plane", "--instrument", "vl53l5cx", "--spp", "8", "-o", file)
    capture = read_capture(file)
    assert capture.spots.readings.shape == (1, 64, 128)
    succeeded("reconstruct", file, "--ranging", "dtof", "-o", folder)
    assert "Laser spots" in (folder / "report.html").read_text(encoding="utf-8")
    figures = json.loads(succeeded("evaluate", file, "--ranging", "dtof", "--json"))
    assert "dtof" in json.dumps(figures)
    middle_m = reconstruct(capture, ranging="dtof").rangings["dtof"].range_m[27]
    assert middle_m == pytest.approx(capture.truth.at(0).spot_range_m[27], abs=0.05)
    assert np.isfinite(middle_m)


@pytest.mark.parametrize("name", ["tmf8820", "vl53l5cx", "vl53l8cx", "rangefinder-905"])
def test_budgets_of_ranging_sensors_are_of_class_1(name: str) -> None:
    figures = json.loads(
        succeeded("budget", name, "--range", "1.5", "--illuminance", "0.3", "--json")
    )
    lasers = figures["eye_safety"]["lasers"]
    assert lasers["laser_class"] == lasers["declared"] == "1"
    assert figures["image"] is None
    assert 0 < figures["range"]["sigma_m"] < 0.02


def test_zones_out_of_bounds_are_a_mistake_of_the_file(tmp_path: Path) -> None:
    text = (PRESETS / "vl53l5cx.yaml").read_text(encoding="utf-8")
    (tmp_path / "mine.yaml").write_text(text.replace("shape: [8, 8] ", "shape: [9, 9] "))
    said = mistake("budget", tmp_path / "mine.yaml")
    assert "zones" in said
    assert "81 zones" in said
