"""Import of glTF, OBJ, STL, PLY and COLLADA: the written scene has the geometry of the file."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml

from foreign import (
    TRIANGLE,
    Y_UP,
    assert_same,
    collada,
    glb,
    taken,
    tetrahedron,
    triangle_header,
    written,
)
from reconstruction.base.errors import InputError
from spisim.scene import enclosing_object, load_scene
from spisim.scene.blocks import distance
from spisim_formats import SceneFormat, import_scene
from spisim_formats.format import readers


def placed(angle: float, offset: list[float], scale: float | list[float] = 1.0) -> np.ndarray:
    matrix = trimesh.transformations.rotation_matrix(angle, [1, 2, 3])
    matrix[:3, 3] = offset
    return matrix @ np.diag([*np.broadcast_to(scale, 3), 1.0])


def named(name: str, color: list[float] | None = None) -> trimesh.visual.TextureVisuals:
    material = trimesh.visual.material.PBRMaterial(name=name, baseColorFactor=color)
    return trimesh.visual.TextureVisuals(material=material)


@pytest.fixture
def scene() -> trimesh.Scene:
    """Nested nodes: a group that holds a wedge three times, a stretched ball, a mirrored wedge."""
    scene = trimesh.Scene()
    wedge, ball = tetrahedron(), trimesh.creation.icosphere(2, 0.5)
    wedge.visual = named("BrickWall.001")
    scene.geometry.update({"wedge": wedge, "ball": ball})
    graph = scene.graph
    graph.update("group", matrix=placed(0.4, [0.5, 1, -2], 2.0))
    graph.update("a", "group", matrix=placed(1.1, [0, 0, 1]), geometry="wedge")
    graph.update("b", "group", matrix=placed(-2, [3, 0, 0]), geometry="wedge")
    graph.update("c", "group", matrix=placed(0.1, [0, 4, 0], 0.5), geometry="wedge")
    graph.update("ball", matrix=placed(0.7, [-3, 0, 0], [1, 2, 3]), geometry="ball")
    graph.update("ball 2", matrix=placed(0.2, [-8, 0, 0], [1, 2, 3]), geometry="ball")
    graph.update("mirrored", matrix=placed(0.3, [0, 0, 5], [1, -1, 1]), geometry="wedge")
    return scene


@pytest.fixture
def report(scene: trimesh.Scene, tmp_path: Path):
    scene.export(tmp_path / "hall.glb")
    return taken(tmp_path / "hall.glb")


def test_nested_nodes_of_glb(scene: trimesh.Scene, report) -> None:
    assert_same(written(report), scene.to_mesh().apply_transform(Y_UP))
    assert report.up == "y"
    assert report.unit_m == 1
    assert report.triangles == len(scene.to_mesh().faces)
    np.testing.assert_allclose(report.bounds_m, written(report).bounds, rtol=0, atol=1e-6)


def test_shared_geometry_is_written_once(report) -> None:
    rows = yaml.safe_load(report.written.scene_file.read_text())["objects"]
    copies = {row["name"]: len(row.get("instances", [1])) for row in rows}
    assert copies == {"a": 2, "c": 1, "ball": 2, "mirrored": 1}
    assert rows[0]["mesh"] == rows[1]["mesh"]
    assert rows[0]["scale"] == pytest.approx(2)
    assert "scale" not in rows[1]
    assert len(report.written.mesh_files) == 3  # wedge, stretched ball, mirrored wedge


def test_the_written_scene_loads_by_itself(report) -> None:
    scene = load_scene(report.written.scene_file)
    assert [thing.name for thing in scene.objects] == ["a-1", "a-2", "c", "ball-1", "ball-2",
                                                       "mirrored"]  # fmt: skip
    assert {thing.material.name for thing in scene.objects} == {"brick", "concrete"}


def test_drone_is_proposed_in_the_open(report) -> None:
    scene, drone = report.written.scene, report.drone
    assert enclosing_object(scene, drone.position_m) is None
    every = written(report).triangles
    assert 1 <= drone.nearest_m <= 10
    assert drone.nearest_m == pytest.approx(distance(drone.position_m, every))
    assert 1 <= drone.ahead_m <= 10


def test_distance_is_that_of_the_nearest_point() -> None:
    triangle = np.array([[[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]])
    cases = {(1, 1, 2): 2, (-3, 1, 0): 3, (4, 4, 0): 8**0.5, (7, 0, 4): 5, (1, -2, 0): 2}
    for point, expected in cases.items():
        assert distance(np.array(point, float), triangle) == pytest.approx(expected)


def test_nodes_below_a_camera_are_kept(tmp_path: Path) -> None:
    nodes = [{"camera": 0, "children": [1], "translation": [0, 0, 2]}, {"mesh": 0}]
    camera = {"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1, "aspectRatio": 1}}
    header = triangle_header(nodes=nodes, cameras=[camera])
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    got = written(taken(tmp_path / "a.glb"))
    np.testing.assert_allclose(got.bounds, [[0, -2, 0], [1, -2, 1]], rtol=0, atol=1e-6)


def test_one_object_per_primitive_and_lines_left_out(tmp_path: Path) -> None:
    row = {"attributes": {"POSITION": 0}}
    primitives = [
        row | {"mode": 1},
        row | {"material": 1},
        row | {"mode": 0},
        row | {"material": 0},
    ]
    meshes = [{"name": "sheet", "primitives": primitives}]
    materials = [{"name": "concrete"}, {"name": "asphalt"}]
    header = triangle_header(meshes=meshes, materials=materials)
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    report = taken(tmp_path / "a.glb")
    result = {thing.name: thing.material.name for thing in report.written.scene.objects}
    assert result == {"sheet": "asphalt", "sheet 2": "concrete"}
    assert any("lines" in note for note in report.notes)


def test_gltf_with_its_buffer_beside_or_inside(tmp_path: Path) -> None:
    beside = triangle_header(buffers=[{"byteLength": 36, "uri": "my%20data.bin"}])
    (tmp_path / "my data.bin").write_bytes(TRIANGLE)
    uri = "data:application/octet-stream;base64," + base64.b64encode(TRIANGLE).decode()
    inside = triangle_header(buffers=[{"byteLength": 36, "uri": uri}])
    for header in (beside, inside):
        (tmp_path / "a.gltf").write_text(json.dumps(header))
        got = written(taken(tmp_path / "a.gltf", overwrite=True))
        np.testing.assert_allclose(got.bounds, [[0, 0, 0], [1, 0, 1]], rtol=0, atol=1e-6)


def test_a_missing_texture_is_a_note(tmp_path: Path) -> None:
    header = triangle_header(images=[{"uri": "gone.png"}])
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    assert any("gone.png" in note for note in taken(tmp_path / "a.glb").notes)


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply"])
def test_files_without_unit_or_axes(tmp_path: Path, suffix: str) -> None:
    mesh = tetrahedron().apply_translation([0, 0, 5])
    mesh.export(tmp_path / f"a.{suffix}")
    report = taken(tmp_path / f"a.{suffix}")
    assert_same(written(report), mesh)
    assert "z" in report.up_why
    assert not report.warnings


@pytest.mark.parametrize(
    ("unit", "metres"), [("mm", 1e-3), ("cm", 1e-2), ("in", 0.0254), ("ft", 0.3048)]
)
def test_units_given(tmp_path: Path, unit: str, metres: float) -> None:
    mesh = tetrahedron().apply_scale(1 / metres)
    mesh.export(tmp_path / "a.stl")
    assert_same(written(taken(tmp_path / "a.stl", units=unit)), tetrahedron())


@pytest.mark.parametrize(
    ("axis", "turned"), [("x", lambda x, y, z: [-y, -z, x]), ("y", lambda x, y, z: [x, -z, y])]
)
def test_axes_given(tmp_path: Path, axis: str, turned) -> None:
    mesh = tetrahedron()
    mesh.export(tmp_path / "a.ply")
    mesh.vertices = np.transpose(turned(*mesh.vertices.T))
    assert mesh.volume == pytest.approx(1)  # no mirror
    assert_same(written(taken(tmp_path / "a.ply", up=axis)), mesh)


def test_scale_multiplies(tmp_path: Path) -> None:
    tetrahedron().export(tmp_path / "a.ply")
    got = written(taken(tmp_path / "a.ply", scale=0.5))
    assert_same(got, tetrahedron().apply_scale(0.5))


@pytest.mark.parametrize(("factor", "width"), [(1e-3, "0.003"), (200, "600")])
def test_doubtful_sizes_are_told(tmp_path: Path, factor: float, width: str) -> None:
    tetrahedron().apply_scale(factor).export(tmp_path / "a.ply")
    warnings = taken(tmp_path / "a.ply").warnings
    assert any(width in text and "--units" in text for text in warnings)


def test_collada_in_millimetres_with_y_up(tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text(collada(texture="gone.png"))
    report = taken(tmp_path / "a.dae")
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    turn[0, 3] = 0.5
    expected = [tetrahedron().apply_transform(turn), tetrahedron().apply_translation([0, 0, -4])]
    assert_same(written(report), trimesh.util.concatenate(expected).apply_transform(Y_UP))
    assert report.unit_m == 0.001
    assert report.up == "y"
    (result, parts), *others = report.materials
    assert (result.source, result.material, parts, others) == ("Rusty Steel", "steel-rusty", 2, [])
    assert any("gone.png" in note for note in report.notes)


@pytest.mark.parametrize(
    ("asset", "up"), [("<up_axis>Z_UP</up_axis>", "z"), ("<up_axis>X_UP</up_axis>", "x"), ("", "y")]
)
def test_collada_without_a_unit(tmp_path: Path, asset: str, up: str) -> None:
    (tmp_path / "a.dae").write_text(collada(asset))
    report = taken(tmp_path / "a.dae")
    assert report.up == up
    assert report.unit_m == 1
    assert "COLLADA then means metres" in report.unit_why
    assert any("--units" in text for text in report.warnings)  # 4000 m


def test_options_win_over_the_file(tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text(collada())
    report = taken(tmp_path / "a.dae", units="cm", up="z")
    assert report.unit_m == 0.01
    assert report.bounds_m[1, 1] == pytest.approx(20)


OBJ = """mtllib a.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
o Box Top
usemtl Red Brick
f 1 2 3 4
usemtl glass
f 1 2 5
o Other
usemtl Red Brick
f 2 3 5
"""


@pytest.mark.parametrize("library", ["newmtl Red Brick\nKd 1 0 0\nmap_Kd -s 1 1 1 no.png\n", None])
def test_obj_objects_and_materials(tmp_path: Path, library: str | None) -> None:
    """Materials go by name even where the library is missing, which is told."""
    (tmp_path / "a.obj").write_text(OBJ)
    if library is not None:
        (tmp_path / "a.mtl").write_text(library)
    report = taken(tmp_path / "a.obj")
    result = sorted((row.name, row.material.name) for row in report.written.scene.objects)
    assert [material for _, material in result] == ["brick", "glass-pane", "brick"]
    assert result[0][0].startswith("Box Top")
    assert written(report).area == pytest.approx(1 + 0.5 + 0.5 * 2**0.5)
    missing = "no.png" if library else "a.mtl"
    assert any(missing in note for note in report.notes)


def test_a_room_is_entered(tmp_path: Path) -> None:
    """From outside of its walls, what is in it is not to be seen."""
    room, crate = trimesh.creation.box((20, 4, 3)), trimesh.creation.box((0.5, 0.5, 0.5))
    room.invert()
    scene = trimesh.Scene()
    scene.geometry.update({"room": room, "crate": crate})
    scene.graph.update("room", geometry="room", matrix=np.eye(4))
    positions = np.random.default_rng(0).uniform([-9, -1.2, -1.7], [9, -0.5, 1.7], (20, 3))
    for i, position in enumerate(positions):
        matrix = trimesh.transformations.translation_matrix(position)
        scene.graph.update(f"crate {i}", geometry="crate", matrix=matrix)
    scene.export(tmp_path / "room.glb")
    report = taken(tmp_path / "room.glb")
    assert (np.abs(report.drone.position_m) < [10, 2, 1.5]).all()
    assert report.drone.nearest_m >= 1
    assert not report.warnings


def test_a_scene_too_tight_for_the_drone_is_seen_from_before_it(tmp_path: Path) -> None:
    trimesh.creation.box((400, 400, 300)).export(tmp_path / "a.ply")
    report = taken(tmp_path / "a.ply")
    assert "in front of everything" in report.drone.why
    assert report.drone.position_m[0] < -200
    assert any("400 m wide" in text for text in report.warnings)
    assert any("nearest to the drone" in text for text in report.warnings)


def test_an_unknown_format_is_refused_with_those_there_are(tmp_path: Path) -> None:
    (tmp_path / "a.crate").write_text("200")
    with pytest.raises(InputError, match=r"unknown format '\.crate': .*\.dae"):
        import_scene(tmp_path / "a.crate", tmp_path / "b.yaml")


def test_two_formats_of_one_suffix_are_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    others = {"ours": SceneFormat("a", {".x": print}), "theirs": SceneFormat("b", {".x": print})}
    monkeypatch.setattr("spisim_formats.format._formats", lambda: others)
    with pytest.raises(InputError, match=r"'ours' and 'theirs' both have the suffix \.x"):
        readers()


def test_obj_in_other_encodings(tmp_path: Path) -> None:
    for coding in ("utf-16", "utf-8-sig"):
        file = tmp_path / f"{coding}.obj"
        file.write_text("v 0 0 0\nv 4 0 0\nv 0 4 0\nf 1 2 3\n", encoding=coding)
        assert taken(file, overwrite=True).triangles == 1


def test_off(tmp_path: Path) -> None:
    tetrahedron().export(tmp_path / "a.off")
    assert_same(written(taken(tmp_path / "a.off")), tetrahedron())
    text = (tmp_path / "a.off").read_text()
    (tmp_path / "cut.off").write_text(text[: len(text) // 2])
    with pytest.raises(InputError, match=r"cut\.off"):
        taken(tmp_path / "cut.off", overwrite=True)


def test_collada_with_commas_and_what_is_not_in_it(tmp_path: Path) -> None:
    """One node shows a camera that is gone; the others are there as before."""
    whole = tmp_path / "whole.dae"
    whole.write_text(collada())
    text = collada().replace("0 0 0 1000 0", "0,0 0,00 0 1000,000 0")
    text = text.replace("0.9 0.9 0.9 1<", "0,900000 0,900000 0,900000 1<")
    gone = '<node name="eye"><instance_camera url="#gone"/></node></visual_scene>'
    (tmp_path / "a.dae").write_text(text.replace("</visual_scene>", gone))
    report = taken(tmp_path / "a.dae")
    assert any("camera '#gone' is not in the file" in note for note in report.notes)
    assert_same(written(report), written(taken(whole, overwrite=True)))


SKIN = """<library_controllers><controller id="k"><skin source="#g">
<bind_shape_matrix>1 0 0 0 0 1 0 7000 0 0 1 0 0 0 0 1</bind_shape_matrix>
<source id="j"><Name_array id="ja" count="1">bone</Name_array><technique_common><accessor
 source="#ja" count="1"><param name="JOINT" type="Name"/></accessor></technique_common></source>
<source id="b"><float_array id="ba" count="16">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</float_array>
<technique_common><accessor source="#ba" count="1" stride="16"><param name="T" type="float4x4"/>
</accessor></technique_common></source>
<source id="w"><float_array id="wa" count="1">1</float_array><technique_common><accessor
 source="#wa" count="1" stride="1"><param name="W" type="float"/></accessor></technique_common>
</source><joints><input semantic="JOINT" source="#j"/>
<input semantic="INV_BIND_MATRIX" source="#b"/></joints>
<vertex_weights count="4"><input semantic="JOINT" source="#j" offset="0"/>
<input semantic="WEIGHT" source="#w" offset="1"/><vcount>1 1 1 1</vcount><v>0 0 0 0 0 0 0 0</v>
</vertex_weights></skin></controller></library_controllers><library_visual_scenes>"""


def test_skins_of_collada_are_as_they_were_bound(tmp_path: Path) -> None:
    text = collada().replace("<library_visual_scenes>", SKIN)
    one, _, two = text.partition('<node id="b"')
    bound = two.replace('instance_geometry url="#g"', 'instance_controller url="#k"')
    (tmp_path / "a.dae").write_text(
        f'{one}<node id="b"{bound.replace("</instance_geometry>", "</instance_controller>", 1)}'
    )
    report = taken(tmp_path / "a.dae")
    assert any("bind pose" in note for note in report.notes)
    expected = tetrahedron().apply_translation([0, 7, -4]).apply_transform(Y_UP)
    np.testing.assert_allclose(written(report).bounds[1][2], expected.bounds[1][2], atol=1e-6)


def test_a_damaged_material_of_gltf_is_a_note(tmp_path: Path) -> None:
    header = triangle_header(materials=[{"pbrMetallicRoughness": [1]}])
    header["meshes"][0]["primitives"][0]["material"] = 0
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    report = taken(tmp_path / "a.glb")
    assert "material 0 is damaged: it is not used" in report.notes


def test_the_drone_looks_at_a_surface_where_the_middle_of_all_is_a_hole(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 1.5 0.5 0\nv 0 3 0\nf 1 2 3 4 5\n"
    )
    drone = taken(tmp_path / "a.obj").drone
    assert drone.why == "proposed"
    assert np.isfinite(drone.ahead_m)
