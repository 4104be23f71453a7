"""A flight recorded frame by frame: its poses, its truth, and what is left when it is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

import spisim
from instruments import write_small
from reconstruction import InputError, read_capture, reconstruct
from reconstruction.capture import Capture
from spisim.scene import load_trajectory
from spisim.simulation.flight import Camera
from spisim.simulation.flight.recording import SEGMENT
from spisim_app.cli import app

SCENE = """
name: hall
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [9, 9], rotate_deg: [0, -90, 0], translate_m: [6, 0, 1],
     material: concrete}
"""
PATH = "t,x,y,z,look_x,look_y,look_z\n0,0,0,1,6,0,1\n0.2,0.2,0,1,6,0,1\n0.35,0.3,0,1,6,0.1,1\n"
FRAMES = 82
ERROR = "correlated_m=0.02,white_deg=0.1,delay_s=0.004"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scene, path, and an instrument of few pixels."""
    folder = tmp_path_factory.mktemp("flight")
    (folder / "hall.yaml").write_text(SCENE)
    (folder / "path.csv").write_text(PATH)
    write_small(folder)
    return folder


def arguments(folder: Path, output: Path, *options: str) -> list[str]:
    files = [str(folder / "hall.yaml"), "--path", str(folder / "path.csv"), "-o", str(output)]
    files += ["--instrument", str(folder / "small.yaml"), "--rate", "frames"]
    return ["fly", *files, "--light", "surrogate", "--pose-error", ERROR, *options]


def fly(folder: Path, output: Path, *options: str) -> Any:
    return CliRunner().invoke(app, arguments(folder, output, *options), env={"COLUMNS": "100"})


@pytest.fixture(scope="module")
def recorded(folder: Path) -> Path:
    output = folder / "whole.h5"
    run = fly(folder, output)
    assert run.exit_code == 0, run.output
    assert f"Wrote {FRAMES} frames to {output}" in run.stderr.replace("\n", "")
    return output


@pytest.fixture(scope="module")
def capture(recorded: Path) -> Capture:
    return read_capture(recorded)


def test_every_frame_has_its_pose_and_its_truth(folder: Path, capture: Capture) -> None:
    path = load_trajectory(folder / "path.csv")
    assert capture.frames == FRAMES
    assert capture.poses is not None
    assert capture.truth is not None
    frame_s = 64 / 15_000
    middles_s = frame_s * (np.arange(FRAMES) + 0.5)
    np.testing.assert_allclose(capture.poses.time_s, middles_s)
    assert capture.truth.frame.tolist() == list(range(FRAMES))
    true_m = np.array([path.pose(time_s)[:3, 3] for time_s in middles_s])
    np.testing.assert_allclose(capture.truth.position_m, true_m, atol=1e-4)
    stated_m = np.array([path.pose(max(time_s - 0.004, 0))[:3, 3] for time_s in middles_s])
    off_m = capture.poses.position_m - stated_m
    assert 0.002 < np.abs(off_m).max() < 0.1
    variance = [0.02**2] * 3 + [np.radians(0.1) ** 2] * 3
    np.testing.assert_allclose(capture.poses.covariance, np.tile(np.diag(variance), (FRAMES, 1, 1)))
    # The wall is square ahead at first.
    np.testing.assert_allclose(capture.truth.corridor_m[:40], 6 - true_m[:40, 0], rtol=2e-4)


def test_frames_are_reconstructed_as_those_of_any_capture(capture: Capture) -> None:
    result = reconstruct(capture, FRAMES - 1)
    assert result.ranges.valid.all()
    off_m = result.ranges.range_m - capture.truth.spot_range_m[-1]
    assert (np.abs(off_m) < 5 * result.ranges.sigma_m).all()


def test_a_flight_goes_on_where_it_was_stopped(
    folder: Path, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, shoot = tmp_path / "flight.h5", Camera.shoot

    def stopped(camera: Camera, motions: Any, first: int) -> Any:
        if first == SEGMENT:
            raise KeyboardInterrupt
        return shoot(camera, motions, first)

    with monkeypatch.context() as patched:
        patched.setattr(Camera, "shoot", stopped)
        run = fly(folder, output)
    assert run.exit_code == 130
    assert "Run the same command again to continue" in run.stderr.replace("\n", " ")
    assert not output.exists()
    other = fly(folder, output, "--seed", "1")
    assert other.exit_code == 2
    assert "holds the begun recording of another flight; remove it" in other.stderr.replace(
        "\n", " "
    )
    again = fly(folder, output)
    assert again.exit_code == 0, again.output
    assert f"({SEGMENT} of them kept)" in again.stderr
    assert output.read_bytes() == recorded.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["flight.h5"]


@pytest.mark.slow
@pytest.mark.parametrize("number", range(10))
def test_a_flight_that_is_killed_goes_on_byte_for_byte(
    folder: Path, recorded: Path, tmp_path: Path, number: int
) -> None:
    output = tmp_path / "flight.h5"
    command = [sys.executable, "-m", "spisim", *arguments(folder, output)]
    parts = tmp_path / ".flight.h5.parts"
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not parts.exists() and process.poll() is None:
        time.sleep(0.01)
    time.sleep(0.03 * number)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert output.read_bytes() == recorded.read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["flight.h5"]


def test_samples_of_a_data_set_may_be_flights(
    folder: Path, tmp_path: Path, no_workers: None
) -> None:
    plan = {
        "name": "flights",
        "samples": 2,
        "scenes": [{"scene": str(folder / "hall.yaml")}],
        "poses": {"count": 1, "flight_s": 0.05, "offset_m": [0.2, 0.2, 0.1]},
        "frames": "flight",
        "light": "surrogate",
        "instrument": str(folder / "small.yaml"),
    }
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan))
    data = spisim.make_dataset(tmp_path / "plan.yaml", tmp_path / "flights")
    assert [len(each) for each in data.sequences()] == [1, 1]
    for sample in data:
        assert sample.capture.frames == 11
        true_m = sample.capture.truth.position_m
        np.testing.assert_allclose(sample.array("pose")[:, :3, 3], true_m, atol=1e-6)
        assert 0.001 < np.linalg.norm(true_m[-1] - true_m[0]) < 0.3
    for wrong, message in (
        ({"poses": 1}, "frames: flight needs poses with flight_s, and a count of 1"),
        ({"keep": {"histograms": True}}, "frames: flight keeps neither transport nor histograms"),
        ({"frames": 2}, "a flight needs at least 2 poses"),
    ):
        (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(plan | wrong))
        with pytest.raises(InputError, match=message):
            spisim.make_dataset(tmp_path / "wrong.yaml", tmp_path / "wrong")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--pose-error", "white=1"), "unknown field 'white'"),
        (("--pose-error", "white_m=-1"), "white_m: should be greater than or equal to 0"),
        (("--pose-error", "delay_s"), "must be NAME=X"),
        (("--pose-error", ""), "'': must be NAME=X,NAME=X,..., X a number"),
        (("--pose-error", "white_m=１"), "'white_m=１': must be NAME=X"),
        (("--pose-error", "white_m=1,white_m=2"), "--pose-error white_m is given twice"),
        (("--pose-error", "delay_s=1e9"), "delay_s: should be less than or equal to 10"),
        (("--rate", "framse"), "--rate framse: must be frames, or a number from 0.01 to 10000"),
        (("--rate", "2"), "--truths, --spacing and --pose-error go with --rate frames"),
        (("--speed", "100"), "a flight of 0.0035 s has 0 frames of 0.004267 s"),
    ],
)
def test_wrong_options_are_named(
    folder: Path, tmp_path: Path, options: tuple[str, ...], message: str
) -> None:
    run = fly(folder, tmp_path / "flight.h5", *options)
    assert run.exit_code == 2
    assert message in run.stderr.replace("\n", " ")
    assert not list(tmp_path.iterdir())
