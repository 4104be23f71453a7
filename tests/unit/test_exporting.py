"""Scenes out to Blender and Gazebo and in again: the same triangles, names and materials."""

import subprocess
import sys
from ctypes.util import find_library
from pathlib import Path
from xml.etree.ElementTree import parse

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from foreign import assert_same, taken
from reconstruction.base.errors import InputError
from spisim.scene import Scene, load_scene
from spisim.scene.shapes import texture_coordinates
from spisim_formats import export_scene
from spisim_formats.sdf.sensors import MODEL, sensor_elements

TEXT = """
name: yard
drone: {position_m: [-4, 0, 1.5], look_at_m: [0, 0, 1]}
ambient: {sun_klx: 40, sun_direction: [0.6, 0, -0.8], sky_klx: 10}
objects:
- {name: ground & "grass", shape: rectangle, size_m: [20, 20], material: grass}
- {name: crate, shape: box, size_m: [1, 2, 3], material: wood-dry, rotate_deg: [10, 20, 30],
   translate_m: [2.5, -1.25, 1.7],
   instances: [{}, {translate_m: [0, 4, 0], rotate_deg: [0, 0, 45]}]}
- {name: mast, shape: cylinder, radius_m: 0.1, height_m: 4, material: steel-galvanised,
   translate_m: [3, 0, 2]}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    (tmp_path / "yard.yaml").write_text(TEXT)
    return load_scene(tmp_path / "yard.yaml")


@pytest.mark.parametrize("suffix", [".glb", ".sdf"])
def test_out_and_in(tmp_path: Path, scene: Scene, suffix: str) -> None:
    files = export_scene(scene, tmp_path / f"out{suffix}")
    assert all(path.is_file() for path in files)
    report = taken(tmp_path / f"out{suffix}")
    back = {thing.mesh.bounds.mean(): thing for thing in report.written.scene.objects}
    assert len(back) == len(scene.objects)
    for thing in scene.objects:
        position = min(back, key=lambda middle: abs(middle - thing.mesh.bounds.mean()))
        assert back[position].material.name == thing.material.name
        np.testing.assert_allclose(back[position].mesh.bounds, thing.mesh.bounds, atol=1e-5)
        assert len(back[position].mesh.faces) == len(thing.mesh.faces)
        if thing.mesh.is_watertight:
            assert_same(back[position].mesh.apply_scale(1e-3), thing.mesh.copy().apply_scale(1e-3))
    assert {match.how for match, _ in report.materials} == {"name"}
    assert any(thing.name.startswith("crate") for thing in report.written.scene.objects)
    square = next(thing for thing in report.written.scene.objects if thing.material.name == "grass")
    assert texture_coordinates(square.mesh) is not None


def test_daylight_of_gazebo(tmp_path: Path, scene: Scene) -> None:
    export_scene(scene, tmp_path / "out.sdf")
    ambient = taken(tmp_path / "out.sdf").written.scene.ambient
    assert (ambient.sun_klx, ambient.sky_klx) == pytest.approx((40, 10))
    np.testing.assert_allclose(ambient.sun_direction, (0.6, 0, -0.8), atol=1e-6)


def test_a_world_has_the_instruments_sensors(tmp_path: Path, scene: Scene, paper) -> None:
    """With the geometry that the instrument's file tells; an import takes no notice of them."""
    sensors = sensor_elements(paper, scene.drone_pose)
    export_scene(scene, tmp_path / "out.sdf", further=sensors)
    report = taken(tmp_path / "out.sdf")
    assert len(report.written.scene.objects) == len(scene.objects)
    assert not report.warnings
    bare = taken(export_scene(scene, tmp_path / "bare.sdf")[0], overwrite=True)
    assert report.notes == bare.notes
    model = parse(tmp_path / "out.sdf").find(f".//model[@name='{MODEL}']")
    body = posed(model.findtext("pose"))
    assert body @ [0, 0, 0, 1] == pytest.approx([-4, 0, 1.5, 1])
    camera = model.find(".//sensor[@type='rgbd_camera']/camera")
    assert float(camera.findtext("horizontal_fov")) == pytest.approx(np.radians(20))
    assert [camera.findtext(f"image/{side}") for side in ("width", "height")] == ["64", "64"]
    rays = model.findall(".//sensor[@type='gpu_lidar']")
    forward = [(body @ posed(ray.findtext("pose")))[:3, 0] for ray in rays]
    expected = paper.lasers.directions @ scene.drone_pose[:3, :3].T
    np.testing.assert_allclose(forward, expected, atol=1e-12)
    assert float(rays[0].findtext("lidar/range/max")) == pytest.approx(10)
    with pytest.raises(InputError, match=r"\.glb has no sensors; those go into worlds of Gazebo"):
        export_scene(scene, tmp_path / "out.glb", further=sensors)


#: Names that SDFormat reserves, cannot have, or has for something else in this world.
ODD_NAMES = ("world", "__mast__", "a::b", "sun", MODEL, 'a & "b" <c>')


def test_names_that_sdformat_refuses_are_changed(tmp_path: Path, paper) -> None:
    path = export_scene(odd_scene(tmp_path), tmp_path / "out.sdf")[0]
    assert parse(path).find("world").get("name") == "scene __a__"
    names = [model.get("name") for model in parse(path).iter("model")]
    assert names == ["scene world", "scene __mast__", "a_b", "sun_", MODEL, 'a & "b" <c>']


def odd_scene(folder: Path) -> Scene:
    """Of objects whose names SDFormat does not take."""
    box = {"shape": "box", "size_m": [1, 1, 1], "material": "concrete"}
    things = [
        box | {"name": name, "translate_m": [3, 2 * number, 1]}
        for number, name in enumerate(ODD_NAMES)
    ]
    drone = {"position_m": [-4, 0, 1.5], "look_at_m": [0, 0, 1]}
    (folder / "odd.yaml").write_text(
        yaml.safe_dump({"name": "__a__", "drone": drone, "objects": things})
    )
    return load_scene(folder / "odd.yaml")


SDFORMAT = next(filter(None, (find_library(f"sdformat{n}") for n in range(16, 8, -1))), None)
#: What `gz sdf --check` calls, in a process of its own.
CHECK = (
    "import ctypes, sys; sys.exit(ctypes.CDLL(sys.argv[1]).cmdCheck(sys.argv[2].encode()) & 255)"
)


@pytest.mark.skipif(SDFORMAT is None, reason="without libsdformat")
@pytest.mark.parametrize("name", ["odd", "yard", "warehouse"])
def test_the_parser_of_sdformat_takes_worlds(tmp_path: Path, scene: Scene, paper, name) -> None:
    worlds = {"odd": odd_scene(tmp_path), "yard": scene, "warehouse": load_scene("warehouse")}
    sensors = sensor_elements(paper, worlds[name].drone_pose)
    path = export_scene(worlds[name], tmp_path / "out.sdf", further=sensors)[0]
    assert checked(path) == (0, "Valid.\n", "")
    path.write_text(path.read_text().replace('type="gpu_lidar"', 'type="lidr"'))
    status, _, complaint = checked(path)
    assert status != 0
    assert "sensor type is missing or invalid" in complaint


def checked(path: Path) -> tuple[int, str, str]:
    """Status, output and complaints of SDFormat's own parser."""
    run = subprocess.run(
        [sys.executable, "-c", CHECK, str(SDFORMAT), str(path)], capture_output=True, text=True
    )
    return run.returncode, run.stdout, run.stderr


def posed(text: str) -> np.ndarray:
    """Pose of SDFormat as a matrix: x, y, z, then angles about the fixed x, y, z."""
    numbers = np.array(text.split(), float)
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", numbers[3:]).as_matrix()
    matrix[:3, 3] = numbers[:3]
    return matrix


def test_what_is_there_stays(tmp_path: Path, scene: Scene) -> None:
    with pytest.raises(InputError, match=r"unknown format '\.gbl': did you mean '\.glb'"):
        export_scene(scene, tmp_path / "a.gbl")
    (tmp_path / "a.glb").write_text("mine")
    with pytest.raises(InputError, match=r"a\.glb exists; --overwrite replaces it"):
        export_scene(scene, tmp_path / "a.glb")
    assert (tmp_path / "a.glb").read_text() == "mine"
    export_scene(scene, tmp_path / "b.sdf")
    export_scene(scene, tmp_path / "b.sdf", overwrite=True)
    (tmp_path / "b-meshes" / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match=r"mine\.txt was not written here"):
        export_scene(scene, tmp_path / "b.sdf", overwrite=True)
    assert not list(tmp_path.glob(".*"))
