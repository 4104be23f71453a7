"""Import of robots (URDF) and of stages (OpenUSD)."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from foreign import assert_same, taken, tetrahedron, written
from reconstruction.base.errors import InputError
from spisim.scene.pose import pose_matrix

ROBOT = """<?xml version="1.0"?><robot name="r">
<material name="brick"><color rgba="0.6 0.2 0.1 1"/></material>
<link name="base"><visual><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry>
 <material name="brick"/></visual></link>
<link name="arm"><visual name="v"><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>
 <geometry><mesh filename="{mesh}" scale="1 1 2"/></geometry></visual></link>
<link name="tip"><visual><geometry><sphere radius="0.5"/></geometry></visual></link>
<joint name="one" type="fixed"><parent link="base"/><child link="arm"/>
 <origin xyz="0 0 4" rpy="0 0 1.5707963267948966"/></joint>
<joint name="two" type="revolute"><parent link="arm"/><child link="tip"/><origin xyz="2 0 0"/>
</joint></robot>"""


def robot(path: Path, mesh: str = "package://arm/w.ply") -> Path:
    (path.parent / "arm").mkdir(exist_ok=True)
    tetrahedron().export(path.parent / "arm" / "w.ply")
    path.write_text(ROBOT.format(mesh=mesh))
    return path


def test_robots(tmp_path: Path) -> None:
    """Links stand where the joints place them, turned with them."""
    report = taken(robot(tmp_path / "r.urdf"))
    base = trimesh.creation.box((1, 2, 3)).apply_translation([0, 0, 1])
    arm_pose = pose_matrix((0, 0, 90), (0, 0, 4))
    arm = tetrahedron().apply_scale([1, 1, 2])
    arm.apply_transform(arm_pose @ pose_matrix((0, 0, 90), (1, 0, 0)))
    tip = trimesh.creation.icosphere(4, 0.5).apply_transform(
        arm_pose @ pose_matrix((0, 0, 0), (2, 0, 0))
    )
    assert_same(written(report), trimesh.util.concatenate([base, arm, tip]))
    by_name = {thing.name: thing.material.name for thing in report.written.scene.objects}
    assert by_name["base"] == "brick"
    assert set(by_name) == {"base", "arm v", "tip"}


@pytest.mark.parametrize(
    ("color", "name", "opacity"),
    [
        ("0 0 0 1", "paint-black", None),
        ("1 1 1 1", "paint-white", None),
        ("1 1 1 0.25", "paint-white, 25 % opaque", 0.25),
    ],
)
def test_links_have_the_colours_of_their_own_materials(
    tmp_path: Path, color: str, name: str, opacity: float | None
) -> None:
    path = robot(tmp_path / "r.urdf")
    own = f'<material name="m1"><color rgba="{color}"/></material>'
    sphere = '<sphere radius="0.5"/></geometry>'
    path.write_text(path.read_text().replace(sphere, sphere + own))
    report = taken(path)
    material = next(o for o in report.written.scene.objects if o.name == "tip").material
    assert (material.name, material.opacity) == (name, opacity)
    assert not report.notes


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("<robot ", "<robo ", "not valid XML"),
        (
            "<material name=",
            '<xacro:macro xmlns:xacro="http://www.ros.org/wiki/xacro"/><material name=',
            "has macros",
        ),
        ('<?xml version="1.0"?>', "<!DOCTYPE robot>", "document type"),
    ],
)
def test_damaged_robots(tmp_path: Path, before: str, after: str, message: str) -> None:
    file = robot(tmp_path / "r.urdf")
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError, match=message):
        taken(file)


@pytest.mark.parametrize(
    ("before", "after", "message", "left"),
    [
        ('<parent link="base"/>', "", "joint 'one': needs a parent and a child", {"base"}),
        ('<parent link="base"/>', '<parent link="tip"/>', "poses go in a circle", {"base"}),
        ('<parent link="base"/>', '<parent link="bas"/>', "did you mean 'base'", {"base"}),
        ('xyz="0 0 4"', 'xyz="0 4"', "'one': xyz: expected 3 finite numbers", {"base"}),
        ("package://arm/w.ply", "../../w.ply", "outside the folders", {"base", "tip"}),
        ("package://arm/w.ply", "package://leg/w.ply", "no file", {"base", "tip"}),
        ("<box size", "<bax size", "geometry bax is unknown", {"arm v", "tip"}),
    ],
)
def test_links_that_cannot_be_read_are_left_out(
    tmp_path: Path, before: str, after: str, message: str, left: set[str]
) -> None:
    """Nothing is shown where nobody knows its place."""
    file = robot(tmp_path / "r.urdf")
    file.write_text(file.read_text().replace(before, after, 1))
    report = taken(file)
    assert any(note.startswith("left out: ") and message in note for note in report.notes)
    assert {thing.name for thing in report.written.scene.objects} == left
    assert any("left out; the notes say" in each for each in report.warnings)


STAGE = """#usda 1.0
(
  metersPerUnit = 0.01
  upAxis = "Y"
)
def Xform "hall"
{{
  double3 xformOp:translate = (100, 0, 0)
  uniform token[] xformOpOrder = ["xformOp:translate"]
  def Cube "crate"
  {{
    double size = 200
  }}
  def Mesh "sheet" (
    prepend apiSchemas = ["MaterialBindingAPI"]
  )
  {{
    point3f[] points = [(0, 0, 0), (100, 0, 0), (100, 0, -200), (0, 0, -200)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = {indices}
    rel material:binding = </Looks/brick>
  }}
  def Cube "ghost"
  {{
    token visibility = "invisible"
  }}
  def Sphere "guide"
  {{
    uniform token purpose = "guide"
  }}
  def "more" (
    references = @{layer}@</ball>
  )
  {{
  }}
}}
def Scope "Looks"
{{
  def Material "brick"
  {{
  }}
}}
"""
LAYER = """#usda 1.0
def Sphere "ball"
{
  double radius = 50
}
"""


def stage(path: Path, indices: str = "[0, 1, 2, 3]", layer: str = "ball.usda") -> Path:
    (path.parent / "ball.usda").write_text(LAYER)
    path.write_text(STAGE.format(indices=indices, layer=layer))
    return path


def test_stages(tmp_path: Path) -> None:
    """Centimetres, y up; a layer beside it; what is hidden is not there."""
    pytest.importorskip("pxr")
    report = taken(stage(tmp_path / "s.usda"))
    crate = trimesh.creation.box((2, 2, 2)).apply_translation([1, 0, 0])
    points = [[1, 0, 0], [2, 0, 0], [2, 2, 0], [1, 2, 0]]
    sheet = trimesh.Trimesh(points, [[0, 1, 2], [0, 2, 3]], process=False)
    ball = trimesh.creation.icosphere(4, 0.5).apply_translation([1, 0, 0])
    by_name = {thing.name: thing for thing in report.written.scene.objects}
    assert set(by_name) == {"crate", "sheet", "more"}
    np.testing.assert_allclose(by_name["crate"].mesh.bounds, crate.bounds, atol=1e-6)
    np.testing.assert_allclose(by_name["sheet"].mesh.bounds, sheet.bounds, atol=1e-6)
    np.testing.assert_allclose(by_name["more"].mesh.bounds, ball.bounds, atol=1e-6)
    assert by_name["sheet"].mesh.area == pytest.approx(2)
    np.testing.assert_allclose(by_name["sheet"].mesh.face_normals, [[0, 0, 1]] * 2, atol=1e-6)
    assert by_name["sheet"].material.name == "brick"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"indices": "[0, 1, 2]"}, "its faces and their corners do not fit"),
        ({"indices": "[0, 1, 2, 9]"}, "vertex not in the file"),
        ({"layer": "gone.usda"}, "there is no such file"),
        ({"layer": "../ball.usda"}, "there is no such file"),
        ({"layer": "/etc/ball.usda"}, "there is no such file"),
        ({"layer": "https://x.org/ball.usda"}, "there is no such file"),
    ],
)
def test_damaged_stages(tmp_path: Path, change: dict, message: str) -> None:
    pytest.importorskip("pxr")
    report = taken(stage(tmp_path / "s.usda", **change))
    assert any(note.startswith("left out: ") and message in note for note in report.notes)
    lost = "more" if "layer" in change else "sheet"
    names = {thing.name for thing in report.written.scene.objects}
    assert names == {"crate", "sheet", "more"} - {lost}


@pytest.mark.parametrize("text", ["#usda 1.0\ndef {", "no stage", "#usda 1.0\n"])
def test_no_stages(tmp_path: Path, text: str) -> None:
    pytest.importorskip("pxr")
    (tmp_path / "s.usda").write_text(text)
    with pytest.raises(InputError, match=r"cannot be read as OpenUSD|holds no triangles"):
        taken(tmp_path / "s.usda")


def test_stages_without_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    with pytest.raises(InputError, match=r"OpenUSD needs a library: install `spisim\[usd\]`"):
        taken(stage(tmp_path / "s.usda"))
