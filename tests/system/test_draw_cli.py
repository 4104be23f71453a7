"""`spisim scenes draw` and `list FAMILY` from outside."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from spisim.scene import draw_scene, load_scene
from spisim.scene.families import FAMILIES, ranges
from spisim_app.cli import app

VALUES = ("target=siemens-star", "distance_m=3", "setting=alone")
STAR = ["targets", "--seed", "7", *(part for value in VALUES for part in ("--set", value))]


def run(*arguments: str | Path) -> Any:
    return CliRunner().invoke(app, ["scenes", *map(str, arguments)], env={"COLUMNS": "160"})


def test_files_of_a_draw_say_what_the_family_draws(tmp_path: Path) -> None:
    done = run("draw", *STAR, "-o", tmp_path / "star.yaml", "--json")
    assert done.exit_code == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["warnings"] == []
    assert [Path(file).name for file in report["written"]] == ["star.yaml", "star.ply"]
    drawn = draw_scene(
        "targets", 7, {"target": "siemens-star", "distance_m": 3, "setting": "alone"}
    )
    loaded = load_scene(tmp_path / "star.yaml")
    np.testing.assert_allclose(loaded.drone_pose, drawn.drone_pose, atol=1e-12)
    assert loaded.ambient == drawn.ambient
    for one, other in zip(loaded.objects, drawn.objects, strict=True):
        assert (one.name, one.material.name) == (other.name, other.material.name)
        # PLY files hold single precision.
        np.testing.assert_allclose(one.mesh.triangles, other.mesh.triangles, atol=1e-6)


def test_the_file_says_how_it_was_drawn(tmp_path: Path) -> None:
    assert run("draw", *STAR, "-o", tmp_path / "star.yaml").exit_code == 0
    first = (tmp_path / "star.yaml").read_text(encoding="utf-8").splitlines()[0]
    assert first == f"# Drawn by `spisim scenes draw {' '.join(STAR)}`."


def test_older_files_stay_unless_they_may_go(tmp_path: Path) -> None:
    (tmp_path / "star.yaml").write_text("mine")
    done = run("draw", *STAR, "-o", tmp_path / "star.yaml")
    assert done.exit_code == 2
    assert "--overwrite" in done.stderr
    assert (tmp_path / "star.yaml").read_text() == "mine"
    assert run("draw", *STAR, "-o", tmp_path / "star.yaml", "--overwrite").exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "reported"),
    [
        (["target"], "did you mean 'targets'"),
        (["targets", "--set", "target"], "should be NAME=VALUE"),
        (["targets", "--set", "target=["], "'[' is not a valid value"),
        (["targets", "--set", "target=plan"], "did you mean 'plane'"),
        (["targets", "--set", "distance_m=far"], "distance_m"),
        (["targets", "--set", "distance_m={a: 1}"], "distance_m"),
    ],
)
def test_what_cannot_be_drawn_leaves_nothing(
    tmp_path: Path, arguments: list[str], reported: str
) -> None:
    done = run("draw", *arguments, "-o", tmp_path / "new" / "a.yaml")
    assert done.exit_code == 2, done.stdout
    assert "Traceback" not in done.stderr
    assert reported in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_parameters_of_a_family_are_told(name: str) -> None:
    done = run("list", name)
    assert done.exit_code == 0, done.stderr
    parameters = ranges(FAMILIES[name].parameters)
    reported = {line.split()[0] for line in done.stdout.splitlines() if line.strip()}
    assert set(parameters) <= reported
    assert json.loads(run("list", name, "--json").stdout)["parameters"] == parameters


def test_an_unknown_family_is_told() -> None:
    done = run("list", "tunel")
    assert done.exit_code == 2
    assert "did you mean 'tunnel'" in done.stderr
