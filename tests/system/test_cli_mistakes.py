"""A user's mistake ends as one message on stderr and status 2, never as a traceback."""

import subprocess
from pathlib import Path

import pytest

from commands import mistake, program
from spisim.scene import scenes_folder

SCENES = scenes_folder()
QUICK = ["--spp", "8", "--seed", "3"]


def test_unknown_scene_names_the_nearest(tmp_path: Path) -> None:
    command = program("simulate", "warehose", "-o", tmp_path / "c.h5")
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "Traceback" not in run.stderr
    assert "did you mean 'warehouse'" in run.stderr


def test_unknown_instrument_names_the_nearest(tmp_path: Path) -> None:
    message = mistake("simulate", "warehouse", "-o", tmp_path / "c.h5", "--instrument", "papers")
    assert "did you mean 'paper'" in message


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--clear", "--visibility", "20"], "exclude each other"),
        (["--visibility", "-1"], "visibility"),
        (["--patterns", "99999"], "patterns"),
        (["--order", "sequenzy"], "did you mean 'sequency'"),
        (["--polarity", "sign"], "'single-ended' or a list of 1 and -1; found 'sign'"),
        (["--polarity", "signed"], "differences of exposures; choose differential"),
        (["--spp", "0"], "0 is not a whole number from 1 to 1048576"),
        (["--spp", "9999999"], "9999999 is not a whole number from"),
        (["--seed", "-1"], "-1 is not a whole number from"),
        (["--seed", str(2**63)], "9223372036854775808 is not a whole number from"),
        (["--frames", "1000000"], "1000000 is not a whole number from"),
        (["--frames", "many"], "many is not a whole number from 1 to 10000"),
        (["--frames", "1.5"], "1.5 is not a whole number"),
    ],
)
def test_bad_options_are_told(options: list[str], reason: str, tmp_path: Path) -> None:
    assert reason in mistake("simulate", "warehouse", "-o", tmp_path / "c.h5", *options)
    assert list(tmp_path.iterdir()) == []


def test_a_bad_scene_file_is_told_with_its_field(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("name: x\nobjets: []\n")
    message = mistake("transport", scene, "-o", tmp_path / "x.exr")
    assert str(scene) in message
    assert "did you mean 'objects'" in message


@pytest.mark.parametrize("command", ["demo", "simulate", "transport", "reconstruct"])
def test_an_output_that_cannot_be_written_is_told_at_once(
    command: str, capture_file: Path, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    arguments: dict[str, list[str | Path]] = {
        "demo": ["-o", "x"],
        "simulate": ["warehouse", "-o", "x.h5"],
        "transport": ["warehouse", "-o", "x.exr"],
        "reconstruct": [capture_file, "-o", "x"],
    }
    *given, name = arguments[command]
    message = mistake(command, *given, tmp_path / "file" / "below" / name).replace("\n", "")
    assert f"{tmp_path / 'file'} is not a folder" in message


@pytest.mark.parametrize("command", ["simulate", "transport"])
def test_a_device_is_no_output(command: str) -> None:
    assert "/dev/full is not a regular file" in mistake(command, "warehouse", "-o", "/dev/full")


@pytest.mark.parametrize("command", ["simulate", "transport", "reconstruct"])
def test_a_command_that_fails_leaves_no_folder(command: str, tmp_path: Path) -> None:
    mistake(command, tmp_path / "none.x", "-o", tmp_path / "new" / "folder" / "x")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_no_capture(tmp_path: Path) -> None:
    assert "is a folder" in mistake("simulate", "warehouse", "-o", tmp_path)
    assert "is a folder" in mistake("evaluate", tmp_path)


def test_a_folder_is_no_scene_and_no_instrument(tmp_path: Path) -> None:
    assert f"{tmp_path} is a folder" in mistake("scenes", "show", tmp_path).replace("\n", "")
    assert f"{tmp_path} is a folder" in mistake("budget", tmp_path).replace("\n", "")


def test_an_unknown_family_is_told_with_its_file(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text("family: tunel\n")
    assert f"{scene}: unknown family 'tunel': did you mean 'tunnel'" in mistake(
        "scenes", "show", scene
    )


@pytest.mark.parametrize("command", ["reconstruct", "evaluate"])
def test_a_foreign_file_is_no_capture(command: str, tmp_path: Path) -> None:
    path = tmp_path / "notes.h5"
    path.write_text("not HDF5")
    options = ["-o", tmp_path] if command == "reconstruct" else []
    assert str(path) in mistake(command, path, *options)
