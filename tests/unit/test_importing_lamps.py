"""Lamps and cameras of Gazebo, glTF, COLLADA and OpenUSD."""

from pathlib import Path

import numpy as np
import pytest

from foreign import TRIANGLE, collada, glb, taken, triangle_header
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
    result = report.written.scene
    assert result.ambient.sun_klx == 100
    lamps = {lamp.name: lamp for lamp in result.lamps}
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


@pytest.mark.parametrize(
    ("attenuation", "amount", "reported"),
    [
        ("<constant>0</constant><linear>0</linear><quadratic>0.5</quadratic>", 6, "W/sr; it ends"),
        ("<constant>0.9</constant><linear>0.01</linear><quadratic>0.001</quadratic>", 3,
         "as 1 / (0.9 + 0.01 d + 0.001 d²) there, as 1 / d² here; it ends at 10 m there"),
        ("<range>500</range>", 3, "as 1 / (1 + 1 d) there, as 1 / d² here"),
    ],
)  # fmt: skip
def test_attenuation_of_gazebo(
    tmp_path: Path, attenuation: str, amount: float, reported: str
) -> None:
    """Light that falls with the square of the distance is as bright here; other is told."""
    file = world(
        tmp_path / "a.sdf",
        "<light name='bulb' type='point'><pose>0 0 5 0 0 0</pose><intensity>3</intensity>"
        f"<attenuation>{attenuation}</attenuation></light>"
        "<light name='night' type='point'><light_on>false</light_on></light>"
        f"<model name='m'><link name='l'>{BOX}</link></model>",
    )
    report = taken(file, lamps="watts")
    (lamp,) = report.written.scene.lamps
    assert lamp.intensity.amount == pytest.approx(amount)
    assert any("'bulb'" in note and reported in note for note in report.notes), report.notes
    assert any("'night' is left out" in note for note in report.notes)


def test_a_lamp_of_gazebo_that_is_dimmer_at_its_edge_is_reported(tmp_path: Path) -> None:
    spot = SPOT.replace("<inner_angle>", "<falloff>0.5</falloff><inner_angle>")
    file = world(tmp_path / "a.sdf", f"<model name='m'><link name='l'>{BOX}{spot}</link></model>")
    notes = taken(file, lamps="watts").notes
    assert any("its edge has the power 0.5 there, 1 here" in note for note in notes)


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


LIGHTS = """<library_lights>
 <light id="p"><technique_common><point><color>3 6 0</color><constant_attenuation>0
 </constant_attenuation><quadratic_attenuation>0.25</quadratic_attenuation></point>
 </technique_common></light>
 <light id="s"><technique_common><spot><color>2 2 2</color><falloff_angle>60</falloff_angle></spot>
 </technique_common></light>
 <light id="d"><technique_common><directional><color>4 4 4</color></directional></technique_common>
 </light>
 <light id="a"><technique_common><ambient><color>1 1 1</color></ambient></technique_common></light>
</library_lights><library_cameras><camera id="c"><optics><technique_common><perspective>
<xfov>40</xfov><znear>0.1</znear><zfar>10</zfar></perspective></technique_common></optics></camera>
</library_cameras><library_visual_scenes>"""
NODES = """<node name="over"><translate>0 9000 0</translate><rotate>1 0 0 -90</rotate>
<instance_light url="#p"/></node><node name="eye"><translate>0 0 9000</translate>
<instance_camera url="#c"/><instance_light url="#s"/><instance_light url="#d"/>
<instance_light url="#a"/></node></visual_scene>"""


def test_lamps_and_cameras_of_collada(tmp_path: Path) -> None:
    """In millimetres: what is 1000 times as near is a million times as bright, of W/sr."""
    text = collada().replace("<library_visual_scenes>", LIGHTS).replace("</visual_scene>", NODES)
    (tmp_path / "a.dae").write_text(text)
    report = taken(tmp_path / "a.dae", lamps="watts")
    point, spot, sun = report.written.scene.lamps
    assert point.intensity.amount == pytest.approx(3 * 4 * 1e-6)
    np.testing.assert_allclose(point.position_m, [0, 0, 9], atol=1e-6)
    assert spot.intensity.amount == pytest.approx(2e-6)
    assert spot.cutoff_rad == spot.beam_rad == pytest.approx(np.radians(30))
    np.testing.assert_allclose(spot.position_m, [0, -9, 0], atol=1e-6)
    for lamp in (spot, sun):
        np.testing.assert_allclose(lamp.direction, [0, 1, 0], atol=1e-6)
    assert sun.irradiance.amount == pytest.approx(4)
    assert any("ambient light is left out" in note for note in report.notes)
    assert report.drone.why == "the file's camera"
    np.testing.assert_allclose(report.drone.position_m, [0, -9, 0], atol=1e-6)


STAGE = """#usda 1.0
(
  metersPerUnit = 1
  upAxis = "Z"
)
def Cube "crate" {{
  double size = 2
}}
def {kind} "lamp" {{
  float inputs:intensity = 2
  float inputs:exposure = 1
  {more}
  double3 xformOp:translate = (0, 0, 4)
  uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""


@pytest.mark.parametrize(
    ("kind", "more", "quantity", "amount"),
    [
        ("SphereLight", "float inputs:radius = 0.5", "intensity", np.pi),
        ("SphereLight", "bool inputs:normalize = 1", "intensity", 1.0),
        ("SphereLight", "float inputs:shaping:cone:angle = 30", "intensity", np.pi),
        ("DistantLight", "bool inputs:normalize = 1", "irradiance", 4.0),
        ("DistantLight", "float inputs:angle = 60", "irradiance", np.pi),
        ("RectLight", "float inputs:width = 0.5", "radiance", 4.0),
        ("DiskLight", "bool inputs:normalize = 1", "radiance", 4 / (np.pi / 4)),
        ("CylinderLight", "float inputs:radius = 0.1", "radiance", 4.0),
        ("DomeLight", "color3f inputs:color = (1, 0.5, 0)", "radiance", 2.0),
        ("DomeLight_1", "asset inputs:texture:file = @b.hdr@", "radiance", 4.0),
    ],
)
def test_lamps_of_usd(tmp_path: Path, kind: str, more: str, quantity: str, amount: float) -> None:
    """Radiances, times the size that a lamp has, or over it."""
    pytest.importorskip("pxr")
    write_hdr(tmp_path / "b.hdr")
    (tmp_path / "a.usda").write_text(STAGE.format(kind=kind, more=more))
    assert len(taken(tmp_path / "a.usda").written.scene.objects) == 1
    report = taken(tmp_path / "a.usda", lamps="watts", overwrite=True)
    (lamp,) = report.written.scene.lamps
    assert getattr(lamp, quantity).amount == pytest.approx(amount, rel=2e-3)
    if quantity != "radiance":
        np.testing.assert_allclose(lamp.direction, [0, 0, -1], atol=1e-6)
    elif not kind.startswith("Dome"):
        panel = next(o.mesh for o in report.written.scene.objects if o.name == "lamp")
        down = panel.face_normals[:, 2] < -0.99
        assert down.all() or kind == "CylinderLight"
        assert panel.bounds[:, 2].mean() == pytest.approx(4, abs=1e-6)
    if "cone" in more:
        assert lamp.cutoff_rad == lamp.beam_rad == pytest.approx(np.radians(30))
    if "b.hdr" in more:  # z up: the picture's middle is in -y, its left quarter in x
        column = int(lamp.picture.max(axis=0).argmax())
        azimuth = (column + 0.5) / lamp.picture.shape[1] * 2 * np.pi
        seen = lamp.to_world @ [np.cos(azimuth), np.sin(azimuth), 0]
        np.testing.assert_allclose(seen, [0, -1, 0], atol=0.3)


@pytest.mark.parametrize(
    ("kind", "more", "reported"),
    [
        ("RectLight", "float inputs:width = 0", "size"),
        ("SphereLight", "color3f inputs:color = (0, 0, 0)", "gives no light"),
        ("GeometryLight", "", "GeometryLight is not read"),
        ("DomeLight", "asset inputs:texture:file = @gone.hdr@", "no file 'gone.hdr'"),
        ("DomeLight", "asset inputs:texture:file = @../b.hdr@", "outside the folders"),
        ("DomeLight", "asset inputs:texture:file = @a.usda@", "no picture that can be read"),
    ],
)
def test_lamps_of_usd_that_are_none(tmp_path: Path, kind: str, more: str, reported: str) -> None:
    pytest.importorskip("pxr")
    (tmp_path / "a.usda").write_text(STAGE.format(kind=kind, more=more))
    report = taken(tmp_path / "a.usda", lamps="watts")
    assert not report.written.scene.lamps
    assert any(reported in note for note in report.notes), report.notes


def write_hdr(path: Path) -> None:
    """Eight rows of 16 pixels, not packed: bright in the middle, dim elsewhere."""
    rgbe = np.zeros((8, 16, 4), np.uint8)
    rgbe[...] = (16, 0, 0, 129)  # 16 / 256 * 2
    rgbe[4, 8] = (128, 0, 0, 129)
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + rgbe.tobytes())
