"""`spisim scenes import` from outside: report, warnings, exit status, and what it leaves."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from foreign import collada, tetrahedron
from spisim.scene import load_scene
from spisim_app.cli import app


def run(*arguments: str | Path, **environment: str) -> Any:
    env = {"COLUMNS": "120", "GZ_SIM_RESOURCE_PATH": "", "GAZEBO_MODEL_PATH": "", **environment}
    return CliRunner().invoke(app, ["scenes", "import", *map(str, arguments)], env=env)


@pytest.fixture
def dae(tmp_path: Path) -> Path:
    (tmp_path / "hall.dae").write_text(collada(texture="gone.png"))
    return tmp_path / "hall.dae"


def test_report_for_people(dae: Path, tmp_path: Path) -> None:
    done = run(dae, "-o", tmp_path / "hall.yaml")
    assert done.exit_code == 0, done.stderr
    reported = ["2, 8 triangles", "0.001 m (unit of the file: millimeter", "y (up_axis", "proposed"]
    reported += ["Rusty Steel", "steel-rusty", "guess", "gone.png", "not used"]
    for word in reported:
        assert word in done.stdout
    assert "Wrote" in done.stderr
    assert len(load_scene(tmp_path / "hall.yaml").objects) == 2


def test_report_for_programs(dae: Path, tmp_path: Path) -> None:
    options = ["--units", "mm", "--up", "y", "--scale", "2", "--drone", "0,-9,1",
               "--look-at", "1,0,2"]  # fmt: skip
    done = run(dae, "-o", tmp_path / "hall.yaml", "--json", *options)
    assert done.exit_code == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["objects"] == 2
    assert report["triangles"] == 8
    assert report["unit_why"] == "--units"
    assert report["up_why"] == "--up"
    assert report["drone"]["position_m"] == [0, -9, 1]
    assert report["drone"]["look_at_m"] == [1, 0, 2]
    assert report["drone"]["nearest_m"] > 1
    assert report["bounds_m"][1][2] == pytest.approx(4)
    (material,) = report["materials"]
    assert material["source"] == "Rusty Steel"
    assert material["parts"] == 2
    assert all(Path(path).is_file() for path in report["written"])


def test_doubtful_sizes_warn_on_stderr(tmp_path: Path) -> None:
    tetrahedron().apply_scale(1000).export(tmp_path / "a.stl")
    done = run(tmp_path / "a.stl", "-o", tmp_path / "a.yaml", "--json")
    assert done.exit_code == 0
    assert "warning: the scene is 3e+03 m wide; if that is wrong, give --units" in done.stderr
    assert json.loads(done.stdout)["warnings"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--units", "mile"], "error: --units: unknown unit 'mile'"),
        (["--up", "q"], "error: --up: unknown axis 'q'"),
        (["--drone", "1,2"], "error: --drone: expected three numbers X,Y,Z; found '1,2'"),
        (["--drone", "0,0,9", "--look-at", "a,b,c"], "error: --look-at: expected three numbers"),
        (["--look-at", "0,0,0"], "error: --look-at goes with --drone"),
        (["--materials", "gone.yaml"], "error: gone.yaml: no such file"),
        (["--model-path", "/nowhere"], "error: --model-path /nowhere: no such folder"),
    ],
)
def test_mistakes(dae: Path, tmp_path: Path, options: list[str], message: str) -> None:
    done = run(dae, "-o", tmp_path / "hall.yaml", *options)
    assert done.exit_code == 2
    assert done.stderr.startswith(message)
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == ["hall.dae"]


def test_it_is_run_twice(dae: Path, tmp_path: Path) -> None:
    assert run(dae, "-o", tmp_path / "hall.yaml").exit_code == 0
    again = run(dae, "-o", tmp_path / "hall.yaml")
    assert again.exit_code == 2
    assert "exists; --overwrite replaces it" in again.stderr
    assert run(dae, "-o", tmp_path / "hall.yaml", "--overwrite").exit_code == 0


def test_gazebos_search_path(tmp_path: Path) -> None:
    box = "<visual name='v'><geometry><box><size>1 1 1</size></box></geometry></visual>"
    (tmp_path / "models" / "crate").mkdir(parents=True)
    (tmp_path / "models" / "crate" / "model.sdf").write_text(
        f"<sdf version='1.9'><model name='crate'><link name='l'>{box}</link></model></sdf>"
    )
    world = tmp_path / "worlds" / "a.world"
    world.parent.mkdir()
    world.write_text(
        "<sdf version='1.9'><world name='w'><include><uri>model://crate</uri></include></world></sdf>"
    )
    assert run(world, "-o", tmp_path / "a.yaml").exit_code == 2
    folders = f"/nowhere:{tmp_path / 'models'}"
    assert run(world, "-o", tmp_path / "a.yaml", GZ_SIM_RESOURCE_PATH=folders).exit_code == 0


def test_a_scene_of_mitsuba(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text('<scene version="3.0.0"><shape type="cube"/></scene>')
    done = run(tmp_path / "a.xml", "-o", tmp_path / "a.yaml", "--json")
    assert done.exit_code == 0, done.stderr
    assert json.loads(done.stdout)["triangles"] == 12


def test_nothing_slow_and_no_renderer_is_imported(tmp_path: Path) -> None:
    """The help needs neither trimesh nor pycollada; only Mitsuba's own scenes need Mitsuba."""
    tetrahedron().export(tmp_path / "a.ply")
    code = f"""
import sys
from typer.testing import CliRunner
from spisim_app.cli import app
assert "spisim_formats.cli.importing" in sys.modules
assert not {{"trimesh", "collada", "numpy"}} & set(sys.modules)
words = ["scenes", "import", {str(tmp_path / "a.ply")!r}, "-o", {str(tmp_path / "a.yaml")!r}]
assert CliRunner().invoke(app, words).exit_code == 0
assert "trimesh" in sys.modules
assert not {{"mitsuba", "drjit", "collada"}} & set(sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
