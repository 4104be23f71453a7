"""The viewer: what is in a recording of Rerun, read back by its own tools, and what is refused."""

import re
import socket
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from captures import make_spots, with_spots
from datasets import make_set
from exported import with_scene
from reconstruction import InputError, write_capture
from spisim_app.cli import app
from spisim_app.report.viewer import Recording, window
from spisim_app.report.viewer.readings import phasors_of
from spisim_app.report.viewer.space import rgb_of_spots
from spisim_app.report.viewer.views import views_of_captures
from streams import film, messages


def view(*words):
    return CliRunner().invoke(app, ["view", *map(str, words)], env={"COLUMNS": "200"})


def entities(path):
    """Paths of all entities of a recording, as Rerun's own program prints them."""
    pytest.importorskip("rerun")
    program = [sys.executable, "-m", "rerun_cli", "rrd", "print", str(path)]
    run = subprocess.run(program, capture_output=True, text=True, check=True, timeout=600)
    return set(re.findall(r" rows \(.*?\) - (/.*?) - ", run.stdout))


@pytest.fixture(scope="module")
def folder(capture, tmp_path_factory):
    folder = tmp_path_factory.mktemp("views")
    recording = with_scene(film(capture, 3))
    write_capture(replace(recording, truth=capture.truth), folder / "hall.h5")
    (folder / "hall.stream").write_bytes(b"".join(messages(recording)))
    return folder


SEEN = {
    *("/images/image", "/depth/depth", "/notes", "/readings/patterns", "/phasors/10\\ MHz"),
    *(f"/{name}/spot_{k}" for name in ("ranges", "sigmas", "readings/taps") for k in range(4)),
    *(f"/world/drone{part}" for part in ("", "/body", "/projector", "/cloud")),
    *(f"/world/drone/spots/{part}" for part in ("beams", "measured", "sigma")),
}
TRUE = {"/images/truth", "/depth/truth", "/world/drone/truth", "/world/drone/spots/truth"}


def test_a_capture_is_shown_with_its_scene_and_truth(folder, tmp_path):
    run = view(folder / "hall.h5", "--save", tmp_path / "hall.rrd")
    assert run.exit_code == 0, run.output
    result = entities(tmp_path / "hall.rrd")
    assert result >= SEEN | TRUE
    assert any(each.startswith("/world/scene/000") for each in result)
    assert [path.name for path in tmp_path.iterdir()] == ["hall.rrd"]
    assert view(folder / "hall.h5", "--save", tmp_path / "hall.rrd").exit_code == 0  # its own
    (tmp_path / "mine.rrd").write_text("mine")
    run = view(folder / "hall.h5", "--save", tmp_path / "mine.rrd")
    assert run.exit_code == 2
    assert "exists and is not an earlier recording of Rerun" in run.output


def test_a_stream_is_shown_as_it_comes(folder, tmp_path):
    run = view(folder / "hall.stream", "--save", tmp_path / "live.rrd")
    assert run.exit_code == 0, run.output
    result = entities(tmp_path / "live.rrd")
    assert result >= SEEN
    assert not result & TRUE


def test_a_data_set_is_shown_sample_by_sample(capture, tmp_path):
    make_set(tmp_path / "walls", with_scene(capture), done=3)
    run = view(tmp_path / "walls", "--save", tmp_path / "walls.rrd", "--frames", "2")
    assert run.exit_code == 0, run.output
    assert entities(tmp_path / "walls.rrd") >= SEEN | TRUE


def test_times_and_places_are_those_of_the_scene(folder):
    views = list(views_of_captures([folder / "hall.h5"]))
    period_ns = round(1e9 * 2 * 128 / 15_000)
    assert np.diff([each.shot.stamp_ns for each in views]).tolist() == pytest.approx(
        [period_ns] * 2, abs=2
    )
    for each in views:
        expected = each.scene.drone_pose_at(each.since_s)
        assert each.shot.pose == pytest.approx(expected, abs=1e-12)
    assert [each.truth is not None for each in views] == [True, False, False]


def test_phasors_are_of_the_taps(capture):
    ((hertz, phasors),) = phasors_of(capture.spots).items()
    assert hertz == 10e6
    path = 2 * np.array([4.2, 4.7, 4.3, 4.8])
    expected = 1e5 * np.exp(2j * np.pi * 10e6 * path / 299_792_458)
    assert phasors == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("method", ["pulsed", "dtof"])
def test_other_readings_are_shown_as_they_are(method, capture, tmp_path):
    spots = make_spots(method)
    readings = {"taps": spots.taps[:1]} if method == "pulsed" else {"counts": spots.counts[:1]}
    spots = replace(spots, saturated=spots.saturated[:1], **readings)
    source = replace(capture.provenance, scene="", source="hardware")
    recorded = replace(capture, spots=spots, provenance=source, truth=None)
    write_capture(recorded, tmp_path / "a.h5")
    run = view(tmp_path / "a.h5", "--save", tmp_path / "a.rrd")
    assert run.exit_code == 0, run.output
    kind = "taps" if method == "pulsed" else "histograms"
    assert f"/readings/{kind}/spot_3" in entities(tmp_path / "a.rrd")


def test_nine_spots_are_shown(capture, tmp_path):
    nine = with_spots(with_scene(capture), [0, 1, 2, 3, 0, 1, 2, 3, 0])
    write_capture(nine, tmp_path / "a.h5")
    run = view(tmp_path / "a.h5", "--save", tmp_path / "a.rrd")
    assert run.exit_code == 0, run.output
    shown = entities(tmp_path / "a.rrd")
    assert {"/readings/taps/spot_8", "/ranges/spot_8", "/ranges/true_8"} <= shown
    assert "/ranges/spot_9" not in shown
    assert len({tuple(colour) for colour in rgb_of_spots(9)}) == 8


def test_a_scene_whose_meshes_are_gone_is_left_out_and_told(capture, tmp_path):
    text = ("name: s\ndrone: {position_m: [0, 0, 0], look_at_m: [1, 0, 0]}\n"
            "objects: [{name: a, mesh: gone.ply, material: concrete}]\n")  # fmt: skip
    write_capture(with_scene(capture, text), tmp_path / "a.h5")
    with warnings.catch_warnings(record=True) as odd:
        warnings.simplefilter("always")
        (frame_view,) = views_of_captures([tmp_path / "a.h5"])
    assert frame_view.scene is None
    assert frame_view.shot.pose[:3, 2] == pytest.approx([1, 0, 0])
    assert any("displayed without its surroundings" in str(each.message) for each in odd)


def test_without_rerun_it_says_how_to_get_it_and_where_the_report_is(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    run = view(folder / "hall.h5")
    assert run.exit_code == 2
    assert "pip install 'spisim[viewer]'" in run.output
    assert "spisim reconstruct" in run.output
    (folder / "hall.html").write_text("page")
    assert (folder / "hall.html").as_uri() in view(folder / "hall.h5").output


def test_without_a_display_it_says_how_to_save(folder, monkeypatch):
    pytest.importorskip("rerun")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    run = view(folder / "hall.h5")
    assert run.exit_code == 2
    assert "no display for the viewer; --save FILE.rrd" in run.output


ATTEMPTS = 10


@pytest.fixture
def unreachable(monkeypatch):
    """A display that nobody serves, and no program in PATH."""
    pytest.importorskip("rerun")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", ":4242")
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(window, "_listens", lambda port: False)


def test_a_display_that_cannot_be_reached_is_told(folder, unreachable):
    run = view(folder / "hall.h5")
    assert run.exit_code == 2, run.output
    assert "the viewer cannot be opened: " in run.stderr
    assert "--save FILE.rrd" in run.stderr
    assert run.stderr.count("\n") == 1


def test_the_viewer_listens_to_this_machine_alone(unreachable):
    said = []
    for _ in range(ATTEMPTS):  # without a display it may end before it listens
        with socket.create_server(("127.0.0.1", 0)) as taken:
            port = taken.getsockname()[1]
        run = subprocess.run(window.command(port), capture_output=True, text=True, timeout=600)
        said = re.findall(
            r"Listening for gRPC connections on ([\d.]+):(\d+)", run.stdout + run.stderr
        )
        if said:
            break
    assert said == [("127.0.0.1", str(port))]


class Gone:
    """A stream to a viewer that was closed."""

    def flush(self):
        raise RuntimeError("connection severed")

    def disconnect(self):
        pass


def test_a_viewer_that_is_closed_meanwhile_is_told(tmp_path):
    pytest.importorskip("rerun")
    recording = Recording(tmp_path / "a.rrd")
    recording._stream.disconnect()
    recording._stream = Gone()
    with pytest.raises(InputError, match="the viewer did not take all frames: connection severed"):
        recording.close()


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("none.h5", "no such capture file"),
        ("empty", "no captures"),
        ("tpc://rig:1", "unknown scheme 'tpc': did you mean 'tcp'"),
        ("hall.h5", "'.rd' is no ending of a recording of Rerun"),
    ],
)
def test_what_cannot_be_shown_is_told(source, message, folder, tmp_path, monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.chdir(folder)
    Path("empty").mkdir(exist_ok=True)
    save = tmp_path / ("a.rd" if source == "hall.h5" else "a.rrd")
    run = view(source, "--save", save)
    assert run.exit_code == 2
    assert message in run.output
    assert not list(tmp_path.iterdir())


def test_a_data_set_without_samples_is_told(capture, tmp_path):
    pytest.importorskip("rerun")
    make_set(tmp_path / "none", capture, done=0, failed=1)
    run = view(tmp_path / "none", "--save", tmp_path / "a.rrd")
    assert run.exit_code == 2
    assert "no finished samples to view" in run.output
    assert not (tmp_path / "a.rrd").exists()
