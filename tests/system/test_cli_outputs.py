"""What commands write where: no file takes the place of another, and any name can be printed."""

import shlex
from pathlib import Path

import pytest

from commands import spisim
from scenefiles import MINIMAL

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


@pytest.mark.parametrize("command", ["simulate", "transport", "picture"])
def test_the_current_folder_is_no_output(command: str) -> None:
    run = spisim(command, "warehouse", "-o", ".")
    assert run.exit_code == 2
    assert "is a folder" in run.stderr


def test_brackets_in_names_are_no_markup(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(MINIMAL.replace("name: wall", f"name: '{ODD_NAME}'"))
    picture = tmp_path / ODD_NAME / "scene.png"
    run = spisim("scenes", "show", scene, "-o", picture)
    assert run.exit_code == 0, run.exception
    assert picture.exists()
    assert f"Wrote {picture}" in run.stderr
    assert "[/x]" in run.stdout


@pytest.mark.parametrize("name", ["capture.h5", "capture.hdf5", f"{ODD_NAME}.h5"])
def test_the_next_step_of_a_simulation_can_be_taken(name: str, tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(MINIMAL)
    capture = tmp_path / name
    run = spisim("simulate", tmp_path / "scene.yaml", "-o", capture, "--spp", "1")
    assert run.exit_code == 0, run.exception
    (line,) = (line for line in run.stderr.splitlines() if line.startswith("Next: spisim "))
    step = spisim(*shlex.split(line)[2:])
    assert step.exit_code == 0, step.stderr
