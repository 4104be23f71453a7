"""Scenes in coordinates of maps: they are moved near the origin, which the report states."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from foreign import TRIANGLE, glb, taken, triangle_header, written
from reconstruction.base.errors import InputError
from spisim_app.cli import app

EAST, NORTH = 477012.34, 5429456.78
#: A wall of 8 m x 6 m, 5 m from a point in UTM coordinates, 110 m up.
CORNERS = np.array([(5, -4, 110), (5, 4, 110), (5, 4, 116), (5, -4, 116)]) + np.array(
    [EAST, NORTH, 0]
)


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    rows = "".join(f"v {x:.3f} {y:.3f} {z:.3f}\n" for x, y, z in CORNERS)
    (tmp_path / "utm.obj").write_text(f"{rows}f 1 2 3 4\n")
    return tmp_path / "utm.obj"


def test_a_scene_in_utm_is_moved_by_whole_metres(wall: Path) -> None:
    report = taken(wall)
    np.testing.assert_array_equal(report.origin_m, np.round([EAST + 5, NORTH, 0]))
    np.testing.assert_allclose(
        np.sort(written(report).vertices, axis=0),
        np.sort(CORNERS - report.origin_m, axis=0),
        atol=1e-6,
    )
    text = yaml.safe_load(report.written.scene_file.read_text())["description"]
    assert text == "imported from utm.obj, whose 477017, 5429457, 0 m is the origin"


def test_a_given_origin(wall: Path) -> None:
    report = taken(wall, origin=(EAST, NORTH, 110))
    np.testing.assert_allclose(report.bounds_m, [[5, -4, 0], [5, 4, 6]], atol=1e-6)
    with pytest.raises(InputError, match=r"reaches 5\.43e\+06 m .* see --origin"):
        taken(wall, origin=(0, 0, 0), overwrite=True)
    with pytest.raises(InputError, match="--origin should be three finite numbers"):
        taken(wall, origin=(0, float("nan"), 0), overwrite=True)


def test_a_kept_origin_costs_no_precision(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 530017.34 8 0\nv 530018.34 8 0\nv 530017.34 9 0\nf 1 2 3\n")
    corners = written(taken(tmp_path / "a.obj", origin=(0, 0, 0))).vertices
    np.testing.assert_allclose(corners[:, 0] - 530017.34, [0, 1, 0], atol=1e-6)


def test_what_is_near_stays(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 9000 0 0\nv 9001 0 0\nv 9000 1 0\nf 1 2 3\n")
    report = taken(tmp_path / "a.obj")
    assert report.bounds_m[0, 0] == 9000
    assert not report.origin_m.any()
    assert "translate_m" not in report.written.scene_file.read_text()


def test_cameras_and_lamps_move_along(tmp_path: Path) -> None:
    lamp = {"type": "point", "intensity": 1.0}
    header = triangle_header(
        nodes=[{"children": [1, 2, 3], "translation": [20000.4, 0, -50000.2]},
               {"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]},
               {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 2, 5]}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}],
        extensions={"KHR_lights_punctual": {"lights": [lamp]}},
    )  # fmt: skip
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    report = taken(tmp_path / "a.glb", lamps="watts")
    np.testing.assert_array_equal(report.origin_m, [20001, 50000, 0])
    np.testing.assert_allclose(report.drone.position_m, [-0.6, -4.8, 0], atol=1e-6)
    fields = yaml.safe_load(report.written.scene_file.read_text())
    np.testing.assert_allclose(fields["lamps"][0]["position_m"], [-0.6, -4.8, 2], atol=1e-6)


def test_the_command_states_the_origin(wall: Path, tmp_path: Path) -> None:
    arguments = ["scenes", "import", str(wall), "--overwrite", "-o", str(tmp_path / "a.yaml")]
    assert "origin   477017, 5429457, 0 m in the file" in CliRunner().invoke(app, arguments).stdout
    given = CliRunner().invoke(app, [*arguments, "--origin", "477000,5429000,100", "--json"])
    assert json.loads(given.stdout)["origin_m"] == [477000, 5429000, 100]
    far = CliRunner().invoke(app, [*arguments, "--drone", "477010,5429457,115"])
    assert "--drone: position and look-at should be" in far.stderr
    assert "of the scene's origin (see --origin)" in far.stderr
    near = CliRunner().invoke(app, [*arguments, "--drone", "4770,54294,115"])
    assert "away; --drone counts from the new origin" in near.stderr


def test_the_drone_counts_from_the_new_origin(wall: Path) -> None:
    report = taken(wall, position_m=(0.0, 0.5, 1.0), look_at_m=(5.0, 0.5, 1.0))
    assert report.drone.position_m.tolist() == [0, 0.5, 1]
    assert report.drone.nearest_m < 200
