"""A flight from the command line: its captures, what is made of them, and going on with them."""

import csv
import html
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from instruments import write_small
from reconstruction import read_capture
from reconstruction.diagnostics import NOT_TRACED
from reconstruction.ranging import RANGED
from spisim.scene import load_trajectory, make_scene
from spisim_app.cli import app

SCENE = """
name: hall
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [9, 9], rotate_deg: [0, -90, 0], translate_m: [6, 0, 1],
     material: concrete}
  - {name: post, shape: box, size_m: [0.3, 0.3, 3], translate_m: [4, 0.2, 1], material: cardboard}
"""
PATH = "t,x,y,z,look_x,look_y,look_z\n0,0,0,1,6,0,1\n1,1,0,1,6,0,1\n2,1.5,0,1,6,0.5,1\n"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Scene, path, and an instrument of few pixels."""
    folder = tmp_path_factory.mktemp("fly")
    (folder / "hall.yaml").write_text(SCENE)
    (folder / "path.csv").write_text(PATH)
    write_small(folder)
    return folder


def fly(folder: Path, output: Path, *options: str) -> Any:
    arguments = ["fly", str(folder / "hall.yaml"), "--path", str(folder / "path.csv"), "-o"]
    arguments += [str(output), "--instrument", str(folder / "small.yaml"), "--spp", "4"]
    return CliRunner().invoke(app, [*arguments, "--rate", "1", *options], env={"COLUMNS": "100"})


@pytest.fixture(scope="module")
def flown(folder: Path) -> Path:
    output = folder / "flown"
    run = fly(folder, output, "--json")
    assert run.exit_code == 0, run.output
    report = json.loads(run.stdout)
    assert (report["captures"], report["kept"], report["duration_s"]) == (3, 0, 2)
    assert all(Path(path).is_file() for path in report["written"])
    assert len(report["written"]) == len(list(output.iterdir())) == 6
    return output


def test_captures_know_pose_and_motion_of_their_instant(folder: Path, flown: Path) -> None:
    flight = load_trajectory(folder / "path.csv")
    for number in range(3):
        capture = read_capture(flown / f"capture-{number:04d}.h5")
        position = make_scene(capture.provenance.scene, folder, "capture")
        assert position.drone_pose == pytest.approx(flight.pose(number), abs=1e-9)
        assert position.drone_velocity_m_s == pytest.approx(flight.velocity(number), abs=1e-12)
        assert capture.provenance.seed == number
    truth = [read_capture(flown / f"capture-{n:04d}.h5").truth.at(0) for n in (0, 1)]
    moved = truth[0].depth_m[:, -1] - truth[1].depth_m[:, -1]  # the wall, right of the post
    assert moved == pytest.approx(1, abs=0.02)


def test_the_path_states_the_weather_unless_the_command_does(folder: Path) -> None:
    (folder / "foggy.csv").write_text("# weather: 50\n" + PATH)
    for options, stated in (((), (0, 50)), (("--weather", "clear"), (1, np.nan))):
        output = folder / f"stated{len(options)}"
        run = fly(folder, output, "--path", str(folder / "foggy.csv"), "--speed", "4", *options)
        assert run.exit_code == 0, run.output
        spots = read_capture(output / "capture-0000.h5").spots
        assert (spots.clear_probability, spots.visibility_m) == pytest.approx(stated, nan_ok=True)


def test_table_tells_poses_and_errors(flown: Path) -> None:
    with (flown / "flight.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["position_x_m"]) for row in rows] == pytest.approx([0, 1, 1.5])
    assert [row["capture"] for row in rows] == [f"capture-{n:04d}.h5" for n in range(3)]
    for row in rows:
        for k in range(4):
            assert row[f"spot_{k}_status"] in RANGED
            error = float(row[f"spot_{k}_range_m"]) - float(row[f"spot_{k}_true_m"])
            assert float(row[f"spot_{k}_error_m"]) == pytest.approx(error, abs=1e-4)
            assert abs(error) < 0.3
        assert float(row["depth_mae_m"]) < 2


def test_animation_has_a_picture_per_capture_in_the_flights_time(flown: Path) -> None:
    with Image.open(flown / "flight.gif") as animation:
        assert animation.n_frames == 3
        assert animation.info["duration"] == 1000
        first = np.asarray(animation.convert("RGB"))
        animation.seek(2)
        assert (np.asarray(animation.convert("RGB")) != first).any()


def test_the_page_has_every_capture(flown: Path) -> None:
    page = (flown / "flight.html").read_text(encoding="utf-8")
    assert [f"capture-{number:04}.h5</small>" in page for number in range(4)] == [1, 1, 1, 0]
    assert page.count("<svg") == 3  # the plan, and errors for wide and for narrow windows


def test_an_interrupted_flight_goes_on(folder: Path, flown: Path) -> None:
    before = {path.name: path.read_bytes() for path in flown.iterdir()}
    first = flown / "capture-0000.h5"
    retained_time = first.stat().st_mtime_ns
    for name in ("capture-0001.h5", "flight.gif"):
        (flown / name).unlink()
        (flown / f".{name}.0123abcd.tmp").write_bytes(before[name][:100])
    run = fly(folder, flown, "--json")
    assert run.exit_code == 0, run.output
    assert json.loads(run.stdout)["kept"] == 2
    assert first.stat().st_mtime_ns == retained_time
    assert {path.name: path.read_bytes() for path in flown.iterdir()} == before


def test_surrogate_light_is_used_and_warned_of_everywhere(folder: Path) -> None:
    output = folder / "guessed"
    options = ("--light", "surrogate", "--json")
    report = json.loads(fly(folder, output, *options).stdout)
    assert report["warnings"][0] == f"capture-0000.h5: {NOT_TRACED}"
    assert read_capture(output / "capture-0000.h5").provenance.is_surrogate
    with (output / "flight.csv").open() as file:
        assert all(row["warnings"].startswith(NOT_TRACED) for row in csv.DictReader(file))
    page = html.unescape((output / "flight.html").read_text(encoding="utf-8"))
    assert page.count(NOT_TRACED) == 1  # above the captures, as it holds for all of them
    assert json.loads(fly(folder, output, *options, "--spp", "7").stdout)["kept"] == 3
    traced = fly(folder, output)
    assert traced.exit_code == 2
    assert "capture-0000.h5 was made with another light" in traced.stderr.replace("\n", " ")


def test_warnings_of_a_capture_stand_in_its_row_and_on_its_tile(folder: Path) -> None:
    """The first looks beside the wall, into the open, the second at it."""
    (folder / "turn.csv").write_text("t,x,y,z,look_x,look_y,look_z\n0,0,0,1,0,6,1\n1,0,0,1,6,0,1\n")
    output = folder / "turned"
    run = fly(folder, output, "--path", str(folder / "turn.csv"))
    assert run.exit_code == 0, run.output
    with (output / "flight.csv").open() as file:
        rows = list(csv.DictReader(file))
    beside, at_wall = (row["warnings"].split(" | ") for row in rows)
    own = [warning for warning in beside if warning not in at_wall]
    assert {
        f"spot {k} is too weak to separate from noise and fog: it has no range" for k in range(4)
    } <= set(own)
    page = html.unescape((output / "flight.html").read_text(encoding="utf-8"))
    tile = page[page.index("capture-0000.h5</small>") : page.index("capture-0001.h5</small>")]
    assert all(f"<li>{warning}</li>" in tile for warning in own)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--speed", "2"), "capture-0002.h5 is not of this flight; use another folder"),
        (("--rate", "2"), "capture-0001.h5 was made with another scene or flight"),
        (("--visibility", "50"), "capture-0000.h5 was made with another scene or flight"),
        (("--seed", "1"), "capture-0000.h5 was made with another seed"),
        (("--spp", "8"), "capture-0000.h5 was made with another spp"),
        (("--instrument", "paper"), "capture-0000.h5 was made with another instrument"),
    ],
)
def test_captures_of_another_flight_are_not_mixed_in(
    folder: Path, flown: Path, options: tuple[str, ...], message: str
) -> None:
    before = {path: path.stat().st_mtime_ns for path in flown.iterdir()}
    run = fly(folder, flown, *options)
    assert run.exit_code == 2
    assert message in run.stderr.replace("\n", " ")
    assert before == {path: path.stat().st_mtime_ns for path in flown.iterdir()}


@pytest.mark.parametrize(
    ("path", "options", "message"),
    [
        ("0,0,0,1,6,0,1\n1,5,0.2,1,6,0.2,1\n", (), "leads through object 'post' at"),
        ("0,0,0,1,6,0,1\n1,1,0,1,6,0,1\n", ("--rate", "500"), "500 captures per second overlap"),
        ("0,0,0,1,6,0,1\n0,1,0,1,6,0,1\n", (), "line 3: time 0 should be later"),
    ],
)
def test_flights_that_cannot_be_flown(
    folder: Path, tmp_path: Path, path: str, options: tuple[str, ...], message: str
) -> None:
    (tmp_path / "path.csv").write_text("t,x,y,z,look_x,look_y,look_z\n" + path)
    for name in ("hall.yaml", "small.yaml"):
        (tmp_path / name).write_text((folder / name).read_text())
    run = fly(tmp_path, tmp_path / "out", *options)
    assert run.exit_code == 2
    assert message in run.stderr.replace("\n", " ")
    assert not (tmp_path / "out").exists()
