"""Lamps and cameras of Gazebo and glTF."""

from pathlib import Path

import numpy as np
import pytest

from foreign import TRIANGLE, glb, taken, triangle_header
from spisim.scene.lamps import solid_angle

BOX = "<visual name='v'><geometry><box/></geometry></visual>"
SPOT = (
    "<light name='head' type='spot'><pose>1 0 0 0 0 0</pose><direction>1 0 0</direction>"
    "<intensity>2</intensity><diffuse>1 0.5 0 1</diffuse><spot><inner_angle>0.5</inner_angle>"
    "<outer_angle>1</outer_angle><falloff>1</falloff></spot></light>"
)


def world(path: Path, body: str) -> Path:
    path.write_text(f"<sdf version='1.9'><world name='w'>{body}</world></sdf>")
    return path


def test_lamps_of_gazebo(tmp_path: Path) -> None:
    """On links they go with their models; the first directional light is the sun."""
    inner = f"<model name='i'><pose>0 0 1 0 0 0</pose><link name='l'>{BOX}{SPOT}</link></model>"
    file = world(
        tmp_path / "a.sdf",
        "<light name='sun' type='directional'><direction>0 0 -1</direction></light>"
        "<light name='bulb' type='point'><pose>0 0 5 0 0 0</pose><intensity>3</intensity></light>"
        "<light name='fill' type='directional'><direction>0 2 0</direction></light>"
        "<light name='out' type='point'><intensity>0</intensity></light>"
        f"<model name='m'><pose degrees='true'>10 0 0 0 0 90</pose>{inner}</model>",
    )
    assert not taken(file).written.scene.lamps
    report = taken(file, lamps="watts", overwrite=True)
    found = report.written.scene
    assert found.ambient.sun_klx == 100
    lamps = {lamp.name: lamp for lamp in found.lamps}
    assert set(lamps) == {"bulb", "fill", "head"}
    assert lamps["bulb"].intensity.amount == pytest.approx(3)
    np.testing.assert_allclose(lamps["bulb"].position_m, [0, 0, 5])
    assert lamps["fill"].irradiance.amount == pytest.approx(1)
    np.testing.assert_allclose(lamps["fill"].direction, [0, 1, 0])
    np.testing.assert_allclose(lamps["head"].position_m, [10, 1, 1], atol=1e-6)
    np.testing.assert_allclose(lamps["head"].direction, [0, 1, 0], atol=1e-6)
    assert lamps["head"].intensity.amount == pytest.approx(1)
    assert lamps["head"].cutoff_rad == pytest.approx(0.5)
    assert lamps["head"].beam_rad == pytest.approx(0.25)
    assert any("'out' is left out" in note for note in report.notes)


def test_an_included_sun(tmp_path: Path) -> None:
    (tmp_path / "sun").mkdir()
    (tmp_path / "sun" / "model.sdf").write_text(
        "<sdf version='1.9'><light name='sun' type='directional'><intensity>0.5</intensity>"
        "<direction>0 1 -1</direction></light></sdf>"
    )
    body = f"<include><uri>sun</uri></include><model name='m'><link name='l'>{BOX}</link></model>"
    ambient = taken(world(tmp_path / "a.sdf", body)).written.scene.ambient
    assert ambient.sun_klx == 50
    np.testing.assert_allclose(ambient.sun_direction, np.array([0, 1, -1]) / 2**0.5, atol=1e-6)


def gltf(folder: Path, lights: list, **node) -> Path:
    """A triangle, and a node above it that looks down the file's -z."""
    header = triangle_header(
        nodes=[{"mesh": 0}, {"translation": [0, 1, 4], **node}],
        scenes=[{"nodes": [0, 1]}],
        extensions={"KHR_lights_punctual": {"lights": lights}},
        cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}],
    )
    (folder / "a.glb").write_bytes(glb(header, TRIANGLE))
    return folder / "a.glb"


SHINING = {"KHR_lights_punctual": {"light": 0}}


@pytest.mark.parametrize(
    ("light", "quantity", "expected"),
    [
        ({"type": "point", "intensity": 20}, "intensity", 0.02),
        ({"type": "spot", "intensity": 20, "color": [1, 0.5, 0]}, "intensity", 0.01),
        ({"type": "directional", "intensity": 500}, "irradiance", 0.5),
    ],
)
def test_lamps_of_gltf(tmp_path: Path, light: dict, quantity: str, expected: float) -> None:
    """In candela and lux, as the file has them."""
    report = taken(gltf(tmp_path, [light], extensions=SHINING), lamps="watts")
    (lamp,) = report.written.scene.lamps
    strength = getattr(lamp, quantity)
    assert strength.luminous
    assert strength.amount == pytest.approx(expected)
    if light["type"] != "directional":
        np.testing.assert_allclose(lamp.position_m, [0, -4, 1], atol=1e-6)
    if light["type"] != "point":
        np.testing.assert_allclose(lamp.direction, [0, 1, 0], atol=1e-6)
    if light["type"] == "spot":
        assert lamp.cutoff_rad == pytest.approx(np.pi / 4)
        assert solid_angle(lamp.cutoff_rad, lamp.beam_rad) < 2


@pytest.mark.parametrize(
    "light",
    [
        {},
        {"type": "area"},
        {"type": "point", "intensity": 0},
        {"type": "spot", "spot": {"outerConeAngle": 0}},
    ],
)
def test_lamps_that_are_none(tmp_path: Path, light: dict) -> None:
    report = taken(gltf(tmp_path, [light], extensions=SHINING), lamps="watts")
    assert not report.written.scene.lamps
    assert any("left out" in note for note in report.notes)


def test_a_camera_of_gltf_is_the_drone(tmp_path: Path) -> None:
    drone = taken(gltf(tmp_path, [], camera=0)).drone
    assert drone.why == "the file's camera"
    np.testing.assert_allclose(drone.position_m, [0, -4, 1], atol=1e-6)
    np.testing.assert_allclose(drone.look_at_m, [0, -3, 1], atol=1e-6)


@pytest.mark.parametrize("matrix", [np.diag([1.0, 1, 0, 1]), np.diag([1.0, np.inf, 1, 1])])
def test_a_damaged_camera_is_no_drone(tmp_path: Path, matrix: np.ndarray) -> None:
    """Flat, or not finite."""
    file = gltf(tmp_path, [], camera=0, translation=[0, 0, 0], matrix=matrix.T.ravel().tolist())
    assert taken(file).drone.why != "the file's camera"


def test_lines_of_obj_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 4 0 0\nv 0 4 0\nf 1 2 3\nl 1 2 3\np 1\n")
    report = taken(tmp_path / "a.obj")
    assert report.triangles == 1
    assert any("points and lines are left out" in note for note in report.notes)
