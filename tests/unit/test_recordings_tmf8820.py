"""Recordings of a TMF8820 become captures of zones; what it cannot have written is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from measured_wall import SHIPPED

from reconstruction import measure_ranges, read_capture
from reconstruction.base.errors import InputError
from reconstruction.cli import importing, main
from spisim.instrument import load_instrument
from spisim_formats.recordings import tmf8820
from spisim_formats.recordings.tmf8820 import RECORDING, load_tmf8820

WALL = SHIPPED / "wall_distances.json"
HISTOGRAMS = [[1] * 128] * 9


def saved(folder: Path, frames) -> Path:
    path = folder / "zones.json"
    path.write_text(json.dumps(frames), encoding="utf-8")
    return path


def test_the_wall_is_ranged_as_near_to_the_arm_as_the_sensor_does():
    poses = json.loads(WALL.read_text())
    spots = load_tmf8820(WALL).spots
    assert spots.counts.shape == (len(poses), 9, 128)
    distance_m = np.array([pose["dist_to_plane"] for pose in poses])
    reported_m = [np.array(pose["distances"][0]["depths_1"]) / 1e3 for pose in poses]
    far = np.flatnonzero(distance_m > 0.159)
    ours = [measure_ranges(spots, pose, "dtof").range_m - distance_m[pose] for pose in far.tolist()]
    sensors = [reported_m[pose] - distance_m[pose] for pose in far.tolist()]
    assert np.sqrt(np.mean(np.square(ours))) < np.sqrt(np.mean(np.square(sensors))) < 0.02


def test_zones_and_bins_are_those_of_the_preset():
    sensor = load_instrument("tmf8820")
    np.testing.assert_allclose(tmf8820.directions(), sensor.zones.directions, atol=1e-9)
    assert pytest.approx(sensor.tof.bin_width_s, rel=1e-3) == tmf8820.BIN_WIDTH_S
    assert sensor.tof.pulses * sensor.tof.diodes == tmf8820.CYCLES


def test_a_file_is_imported_by_its_content(tmp_path, monkeypatch, capsys):
    assert RECORDING.recognises(WALL)
    assert not RECORDING.recognises(saved(tmp_path, [{"counts": [1, 2]}]))
    assert not RECORDING.recognises(tmp_path / "wall.csv")
    monkeypatch.setattr(importing, "program_of", lambda path: RECORDING)
    assert main(["import", str(WALL), "-o", str(tmp_path / "a.h5")]) == 0
    capture = read_capture(tmp_path / "a.h5")
    assert capture.spots.counts.shape[1:] == (9, 128)
    assert not capture.plan.shows_image
    assert "128 bins" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("match", "frames"),
    [
        ("should hold a list of frames", {"hists": HISTOGRAMS}),
        ("should hold a list of frames", []),
        (r"hists has shape \(9, 64\), expected \(9, 128\)", [{"hists": [[1] * 64] * 9}]),
        (r"hists has shape \(\), expected", [{"reference_hist": [1] * 128}]),
        ("reference_hist has shape", [{"hists": HISTOGRAMS}]),
        ("hists should hold numbers", [{"hists": "many"}]),
        ("whole numbers from 0", [{"hists": [[-1] * 128] * 9, "reference_hist": [1] * 128}]),
        ("reference_hist is empty", [{"hists": HISTOGRAMS, "reference_hist": [0] * 128}]),
        ("12800000 arrivals", [{"hists": [[10**5] * 128] * 9, "reference_hist": [1] * 128}]),
    ],
)
def test_what_the_sensor_cannot_have_written_is_refused(tmp_path, match, frames):
    with pytest.raises(InputError, match=match):
        load_tmf8820(saved(tmp_path, frames))


def test_a_file_that_is_no_json_or_not_there_is_refused(tmp_path):
    (tmp_path / "a.json").write_text("[{", encoding="utf-8")
    with pytest.raises(InputError, match="not readable as JSON"):
        load_tmf8820(tmp_path / "a.json")
    with pytest.raises(InputError, match="no such file"):
        load_tmf8820(tmp_path / "b.json")
    with pytest.raises(InputError, match="leave out the band"):
        RECORDING.load(WALL, (900.0, 1000.0))
