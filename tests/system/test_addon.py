"""What another package adds goes through everything, without a change here."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import addon
from plugins import install
from reconstruction.errors import InputError
from scenefiles import MINIMAL
from spisim.instrument import load_instrument

SENSOR = {"type": "sipm", "photoactive_area_mm2": 0.02, "detection_efficiency": 0.2}
SENSOR |= {"dark_count_rate_hz": 1e4, "dead_time_s": 0.0, "cells": 100_000}


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the package, an instrument, a scene and a plan that need it."""
    folder = tmp_path_factory.mktemp("addon")
    install(folder, "addon", addon.ENTRIES, Path(addon.__file__).read_text(encoding="utf-8"))
    fields: dict[str, Any] = yaml.safe_load(load_instrument("spad").text)
    fields["projector"]["shape"] = [8, 8]
    fields["plan"] |= {"patterns": 63}
    fields["detector"] |= {"sensor": SENSOR, "amplifier": None, "adc": None}
    detector = fields["tof"]["detector"] | {"sensor": SENSOR}
    fields["tof"] = {"method": "fmcw", "chirp_hz": 1e9, "time_s": 1e-3, "detector": detector}
    (folder / "mine.yaml").write_text(yaml.safe_dump(fields))
    (folder / "dusty.yaml").write_text(MINIMAL + "dust: {mass_mg_per_m3: 10}\n")
    plan = {
        "name": "dusty",
        "scenes": [{"scene": "dusty.yaml"}],
        "instrument": "mine.yaml",
        "spp": 4,
    }
    (folder / "plan.yaml").write_text(yaml.safe_dump(plan | {"samples": 2}))
    return folder


def spisim(place: Path, *arguments: str) -> str:
    """What a command prints where the package is installed; it has been imported before."""
    code = "import addon; from spisim.cli import main; main()"
    path = os.pathsep.join([str(place), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=place,
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_budget_is_that_of_the_parts(place: Path) -> None:
    told = json.loads(spisim(place, "budget", "mine.yaml", "--json", "-o", "budget.png"))
    assert told["range"]["method"] == "fmcw"
    assert 0 < told["range"]["sigma_m"] < 1
    assert (place / "budget.png").stat().st_size > 10_000
    schema = json.loads(spisim(place, "schema", "instrument"))
    assert {"SiPm", "FmcwTof", "Spad", "CwTof"} <= schema["$defs"].keys()
    assert "dust" in spisim(place, "schema", "scene")


def test_recordings_are_made_reconstructed_and_exported(place: Path) -> None:
    spisim(place, "dataset", "run", "plan.yaml", "-o", "set", "--workers", "1")
    (first, _) = sorted(place.glob("set/**/*.h5"))
    spisim(place, "reconstruct", str(first), "-o", "out")
    assert "fmcw" in (place / "out" / "report.html").read_text(encoding="utf-8")
    metrics = json.loads(spisim(place, "evaluate", str(first), "out", "--json"))
    assert all(abs(spot["error_m"]) < 0.1 for spot in metrics["spots"]["fmcw"])
    spisim(place, "dataset", "export", "set", "-o", "arrays", "--format", "npy")
    assert np.load(place / "arrays" / "counts.npy").shape == (2, 64)
    assert spisim(place, "dataset", "export", "--formats").split() == ["webdataset", "npy"]


def test_without_the_package_the_nearest_name_is_told(place: Path) -> None:
    with pytest.raises(InputError, match=r"detector\.sensor: type 'sipm' is unknown: .*spad"):
        load_instrument(place / "mine.yaml")
