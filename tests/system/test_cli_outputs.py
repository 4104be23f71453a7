"""What commands write where: no file takes the place of another's, and any name can be printed."""

import shlex
import shutil
import tarfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from typer.main import get_command

from badinputs import snapshot
from commands import mistake, spisim
from datasets import make_set
from holders import held
from reconstruction import Capture
from reconstruction.base.files import is_marked
from reconstruction.cli import main as rig
from scenefiles import MINIMAL
from spisim.instrument.model import PRESETS
from spisim.scene import scenes_folder
from spisim.simulation.light.files import write_histograms
from spisim_app.cli import app

ODD_NAME = "a [red]b[/x] :car:"


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "warehouse", "--report", "-o", "x.html"],
        ["transport", "warehouse", "-o", "x.npz"],
        ["picture", "warehouse", "-o", "x.png"],
    ],
)
def test_the_name_of_a_second_output_is_not_that_of_the_first(
    arguments: list[str], tmp_path: Path
) -> None:
    *options, name = arguments
    run = spisim(*options, tmp_path / name)
    assert run.exit_code == 2
    assert f"{tmp_path / name}: " in run.stderr
    assert "is no ending of a" in run.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("command", "first", "second"),
    [
        ("simulate --report", "x.h5", "x.html"),
        ("transport", "x.exr", "x.npz"),
        ("picture", "x.exr", "x.png"),
    ],
)
def test_a_second_output_that_cannot_be_written_is_told_at_once(
    command: str, first: str, second: str, tmp_path: Path
) -> None:
    (tmp_path / second).mkdir()
    run = spisim(*command.split(), "warehouse", "-o", tmp_path / first)
    assert run.exit_code == 2
    assert f"{second} is a folder" in run.stderr
    assert [path.name for path in tmp_path.iterdir()] == [second]


@pytest.mark.parametrize("output", [".", "/", ""])
@pytest.mark.parametrize(
    "command",
    [
        "simulate warehouse -o",
        "transport warehouse -o",
        "picture warehouse -o",
        "scenes draw targets -o",
        "scenes export warehouse -o",
        "serve warehouse --record",
    ],
)
def test_a_folder_without_a_name_is_no_file(command: str, output: str) -> None:
    assert "is a folder" in mistake(*command.split(), output)


def test_an_export_is_no_folder_without_a_name(place: Path) -> None:
    (place / "empty").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place / "empty")
        assert "the name of a new one is needed" in mistake("export", "../capture.h5", "-o", ".")


DESIGN = """
name: times
search: [{scene: warehouse}]
judgement: [{scene: tunnel}]
choose: {tof.times: {low: [0.1, 0.1, 0.1], high: [1, 1, 1]}}
weathers: {fog: {fog: {visibility_m: 50}}}
objectives: [range_error_m]
instrument: fog
"""
#: Commands that write a folder, or a file with a folder beside it, by what they hold meanwhile.
HOLDERS = {
    "out/.lock": [
        "demo -o out",
        "reconstruct capture.h5 -o out",
        "fly scene.yaml --path path.csv -o out",
        "study fog-and-rain -o out",
        "paper table2 -o out",
        "dataset run plan.yaml -o out",
        "dataset export set -o out",
        "design design.yaml -o out",
    ],
    ".out.lock": [
        "export capture.h5 -o out",
        "dataset export set -o out --format rgbd",
        "dataset pack set -o out",
    ],
    ".out.yaml.lock": ["scenes draw targets -o out.yaml", "scenes import wall.ply -o out.yaml"],
    ".out.sdf.lock": ["scenes export scene.yaml -o out.sdf"],
}
RIG = ["reconstruct capture.h5 -o out", "live capture.h5 --to out"]


@pytest.mark.parametrize(
    ("lock", "command"), [(lock, command) for lock in HOLDERS for command in HOLDERS[lock]]
)
def test_what_another_program_writes_into_is_refused(
    lock: str, command: str, place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(place)
    (place / "plan.yaml").write_text("name: some\nsamples: 1\nscenes: [{family: targets}]\n")
    (place / "design.yaml").write_text(DESIGN)
    trimesh.creation.box().export(place / "wall.ply")
    with held(place / lock):
        before = snapshot(place)
        reported = mistake(*command.split())
        assert "process 123 on there is writing into it; wait for it or end it" in reported
        assert snapshot(place) == before


@pytest.mark.parametrize("command", RIG)
def test_the_rig_refuses_it_too(
    command: str,
    place: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(place)
    with held(place / "out/.lock"):
        assert rig(command.split()) == 2
        assert "process 123 on there is writing into it" in capsys.readouterr().err


def test_every_command_that_writes_a_folder_is_tried() -> None:
    tried = {command.partition(" -o")[0] for commands in HOLDERS.values() for command in commands}

    def verbs(group: Any, name: str = "") -> Iterator[str]:
        for word, command in getattr(group, "commands", {}).items():
            yield from verbs(command, f"{name}{word} ")
            metavars = [each.metavar for each in command.params if "-o" in each.opts]
            if {"DIR", "OUT"} & set(metavars):
                yield f"{name}{word}"

    for verb in verbs(get_command(app)):
        assert any(each.startswith(verb) for each in tried), verb


def test_brackets_in_names_are_no_markup(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(MINIMAL.replace("name: wall", f"name: '{ODD_NAME}'"))
    picture = tmp_path / ODD_NAME / "scene.png"
    run = spisim("scenes", "show", scene, "-o", picture)
    assert run.exit_code == 0, run.exception
    assert picture.exists()
    assert f"Wrote {picture}" in run.stderr
    assert "[/x]" in run.stdout


@pytest.mark.parametrize("name", ["capture.h5", f"{ODD_NAME}.hdf5"])
def test_the_next_step_of_a_simulation_can_be_taken(name: str, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(MINIMAL)
    capture = tmp_path / name
    run = spisim("simulate", tmp_path / "scene.yaml", "-o", capture, "--spp", "1")
    assert run.exit_code == 0, run.exception
    (line,) = (line for line in run.stderr.splitlines() if line.startswith("Next: spisim "))
    step = spisim(*shlex.split(line)[2:])
    assert step.exit_code == 0, step.stderr


@pytest.fixture
def place(capture_file: Path, capture: Capture, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to work in, with an input of each kind."""
    folder = capture_file.parent
    monkeypatch.chdir(folder)
    (folder / "scene.yaml").write_text(MINIMAL)
    shutil.copy(PRESETS / "paper.yaml", folder / "paper.yaml")
    np.save(folder / "readings.npy", np.arange(64.0))
    make_set(folder / "set", capture, done=2, failed=0)
    return folder


#: Commands, the files that they write, and the marks of those.
WRITTEN: dict[str, dict[str, str]] = {
    "simulate scene.yaml --spp 1 -o c.h5 --report": {
        "c.h5": "simulated capture",
        "c.html": "capture report",
    },
    "transport scene.yaml --spp 1 -o t.exr --frequency 1e6 --orders": {
        "t.exr": "transport image",
        "t.npz": "histograms",
    },
    "picture scene.yaml --spp 1 --width 8 --height 8 -o p.exr": {
        "p.exr": "radiance",
        "p.png": "picture",
    },
    "reconstruct capture.h5 -o result": {
        "result/result.h5": "result",
        "result/image.png": "image",
        "result/depth.png": "depth",
        "result/cloud.ply": "point cloud",
        "result/report.html": "capture report",
    },
    "scenes show scene.yaml -o s.png": {"s.png": "scene view"},
    "budget paper.yaml -o b.png": {"b.png": "budget"},
    "paper table2 -o figures": {"figures/table2.png": "figure of the paper"},
    "dataset sheet set -o sheet.html": {"sheet.html": "contact sheet"},
}


#: The quick ones among them.
FAST = ("picture", "reconstruct", "dataset")


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(each, marks=() if each.startswith(FAST) else pytest.mark.slow)
        for each in WRITTEN
    ],
)
def test_own_files_are_overwritten_and_others_only_where_that_is_asked_for(
    command: str, place: Path
) -> None:
    words, files = command.split(), WRITTEN[command]
    first = list(files)[-1]
    Path(first).parent.mkdir(exist_ok=True)
    Path(first).write_text("of someone else")
    before = snapshot(place)
    assert f"{first} exists and is not an earlier {files[first]}" in mistake(*words)
    assert snapshot(place) == before
    for options in (["--overwrite"], []):
        run = spisim(*words, *options)
        assert run.exit_code == 0, run.stderr
    assert all(is_marked(file, kind) for file, kind in files.items())


def test_arrays_with_a_mark_are_read(place: Path) -> None:
    path = place / "light.npz"
    light = SimpleNamespace(
        spot_histogram=np.ones((4, 9)), path_length_m=np.arange(9.0), extra={"cube": np.ones(3)}
    )
    write_histograms(path, light)  # type: ignore[arg-type]
    once = path.read_bytes()
    write_histograms(path, light)  # type: ignore[arg-type]
    assert path.read_bytes() == once
    with np.load(path) as arrays:
        assert arrays["cube"].tolist() == [1, 1, 1]
        assert str(arrays["units.path_length_m"]) == "m"


@pytest.mark.parametrize(
    "command",
    [
        "simulate scene.yaml -o {}",
        "transport scene.yaml -o {}",
        "picture scene.yaml -o {}",
        "scenes show scene.yaml -o {}",
        "budget scene.yaml -o {}",
    ],
)
@pytest.mark.parametrize("option", ["", " --overwrite"])
def test_no_input_becomes_an_output(command: str, option: str, place: Path) -> None:
    before = snapshot(place)
    message = mistake(*(command.format("scene.yaml") + option).split())
    assert "scene.yaml is read by this command" in message
    assert snapshot(place) == before


def test_what_a_scene_refers_to_is_no_output(place: Path) -> None:
    shutil.copy(scenes_folder() / "meshes" / "cone.ply", place / "cone.png")
    thing = "  - {name: b, mesh: cone.png, material: concrete}\n"
    (place / "scene.yaml").write_text(MINIMAL + thing)
    message = mistake("scenes", "show", "scene.yaml", "-o", "cone.png", "--overwrite")
    assert "cone.png is read by this command" in message


def test_a_recording_is_no_output_of_its_import(place: Path) -> None:
    arguments = ["import", "readings.npy", "--shape", "8x8", "-o"]
    assert rig([*arguments, "new.h5"]) == 0
    assert rig([*arguments, "new.h5"]) == 0
    assert is_marked("new.h5", "hardware capture")
    shutil.copy("readings.npy", "readings.h5")
    for name in ("readings.npy", "readings.h5", "capture.h5"):
        before = Path(name).read_bytes()
        assert rig([*arguments, name]) == 2
        assert Path(name).read_bytes() == before
    assert rig([*arguments, "readings.h5", "--overwrite"]) == 0


def test_pictures_of_others_stay_where_a_result_has_none(place: Path) -> None:
    both = ["--image", "pursuit,pursuit:dct"]
    assert spisim("reconstruct", "capture.h5", "-o", "out", *both).exit_code == 0
    own, foreign = Path("out/image_pursuit_dct.png"), Path("out/depth_nearest.png")
    foreign.write_text("of someone else")
    arguments = ["reconstruct", "capture.h5", "-o", "out", "--image", "pursuit"]
    assert own.exists()
    assert "depth_nearest.png exists and is not an earlier depth" in mistake(*arguments)
    assert own.exists()
    run = spisim(*arguments, "--depth", "anchored", "--overwrite")
    assert run.exit_code == 0, run.stderr
    assert not own.exists()
    assert foreign.read_text() == "of someone else"


def test_a_scene_takes_only_meshes_of_its_own_along(place: Path) -> None:
    draw = ["scenes", "draw", "targets", "--seed", "7", "-o", "star.yaml"]
    meshed = ["scenes", "import", "cone.ply", "-o", "cone.yaml", "--drone", "3,0,1"]
    shutil.copy(scenes_folder() / "meshes" / "cone.ply", place / "cone.ply")
    for command in (draw, meshed):
        assert spisim(*command).exit_code == 0
        assert "exists; --overwrite replaces it" in mistake(*command)
        run = spisim(*command, "--overwrite")
        assert run.exit_code == 0, run.stderr
    (mesh,) = Path("cone-meshes").iterdir()
    assert is_marked(mesh, "mesh")
    taken = ["scenes", "import", mesh, "-o", "cone.yaml", "--drone", "3,0,1", "--overwrite"]
    assert "is read by this command" in mistake(*taken)
    Path("cone-meshes/notes.txt").write_text("of someone else")
    assert "notes.txt was not written here" in mistake(*meshed, "--overwrite")
    assert Path("cone-meshes/notes.txt").exists()
    assert mesh.exists()


def test_a_plan_is_not_changed_by_its_own_data_set(place: Path) -> None:
    plan = place / "new" / "plan.yaml"
    plan.parent.mkdir()
    plan.write_text("name: x\nsamples: 1\nscenes: [{family: targets}]\n")
    message = mistake("dataset", plan, "-o", plan.parent, "--samples", "2")
    assert "--samples would change" in message
    assert list(plan.parent.iterdir()) == [plan]


def test_shards_of_others_stay(place: Path) -> None:
    for _ in range(2):
        run = spisim("dataset", "export", "set", "-o", "shards")
        assert run.exit_code == 0, run.stderr
    shard = Path("shards/shard-000000.tar")
    assert is_marked(shard, "export")
    with tarfile.open(shard) as tar:
        assert tar.getnames()[:2] == ["000000.h5", "000000.json"]
    shard.write_text("of someone else")
    assert "belongs to another export" in mistake("dataset", "export", "set", "-o", "shards")
    assert shard.read_text() == "of someone else"
