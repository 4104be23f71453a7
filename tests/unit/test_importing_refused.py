"""What an import refuses: damaged, hostile and huge files, in a sentence, nothing written."""

import itertools
import json
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from foreign import TRIANGLE, collada, glb, glb_of_text, taken, tetrahedron, triangle_header
from reconstruction.base.errors import InputError
from spisim_formats import Options, import_scene
from spisim_formats.library import files as reading

PNG = b"\x89PNG\r\n\x1a\n" + bytes(100)
LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "ha">'
    + "".join(
        f'<!ENTITY {name} "{f"&{before};" * 10}">'
        for before, name in itertools.pairwise("abcdefghij")
    )
    + "]>{}"
)
OUTSIDE = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/hostname">]>{}'
MITSUBA = '<scene version="3.0.0"><shape type="cube" id="&a;"/></scene>'
SDF = '<sdf version="1.9"><model name="&a;"/></sdf>'


def refused(file: Path, message: str, **options: Any) -> None:
    """Importing raises one sentence that names the file or option, and leaves nothing behind."""
    before = sorted(file.parent.rglob("*"))
    with pytest.raises(InputError, match=message) as reported:
        taken(file, **options)
    assert "\n" not in str(reported.value)
    assert any(name in str(reported.value) for name in ("--", "scene.yaml", file.name))
    assert sorted(file.parent.rglob("*")) == before


@pytest.mark.parametrize("name", ["a.glb", "a.gltf", "a.obj", "a.stl", "a.ply", "a.dae", "a.sdf",
                                  "a.xml"])  # fmt: skip
class TestEveryFormat:
    def test_missing(self, tmp_path: Path, name: str) -> None:
        refused(tmp_path / name, "no such file")

    def test_empty(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).write_bytes(b"")
        refused(tmp_path / name, "the file is empty")

    def test_a_picture_by_that_name(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).write_bytes(PNG)
        refused(tmp_path / name, "cannot be read as|not valid XML")

    def test_text_by_that_name(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).write_text("hello, world\n" * 20)
        refused(tmp_path / name, "cannot be read as|not valid XML|holds no triangles")

    def test_too_large(self, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
        """Refused by its size, before it is read; the file is a hole."""
        with (tmp_path / name).open("wb") as file:
            file.truncate(reading.MAX_FILE_BYTES + 1)
        monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"{path} is read"))
        refused(tmp_path / name, "more than 2 GB are not read")

    def test_a_device(self, tmp_path: Path, name: str) -> None:
        (tmp_path / name).symlink_to("/dev/zero")
        refused(tmp_path / name, "no such file")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.glbb", "unknown format '.glbb': did you mean '.glb'"),
        ("a", "unknown format ''"),
        ("a.zip", "archives are not read; unpack it"),
        ("a.zae", "archives are not read; unpack it"),
    ],
)
def test_unknown_formats(tmp_path: Path, name: str, message: str) -> None:
    (tmp_path / name).write_bytes(b"PK\x03\x04")
    refused(tmp_path / name, message)


@pytest.mark.parametrize("bomb", [LAUGHS, OUTSIDE], ids=["laughs", "outside"])
@pytest.mark.parametrize(
    ("name", "text"), [("a.xml", MITSUBA), ("a.sdf", SDF), ("a.dae", collada())]
)
def test_document_types(tmp_path: Path, name: str, text: str, bomb: str) -> None:
    """No entity is expanded and no other file read: the declaration itself ends it."""
    content = text.replace('<?xml version="1.0" encoding="utf-8"?>\n', "")
    (tmp_path / name).write_text(bomb.format(content))
    refused(tmp_path / name, "has a document type")


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_document_types_in_other_encodings(tmp_path: Path, encoding: str) -> None:
    text = OUTSIDE.format(MITSUBA).replace('<?xml version="1.0"?>', "")
    (tmp_path / "a.xml").write_bytes(text.encode(encoding))
    refused(tmp_path / "a.xml", "has a document type")


@pytest.mark.parametrize("name", ["a.xml", "a.sdf", "a.dae"])
def test_xml_that_is_nested_too_deeply(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("<a>" * 100_000 + "</a>" * 100_000)
    refused(tmp_path / name, "nested more than 200 deep")


@pytest.mark.parametrize("name", ["a.xml", "a.sdf", "a.dae"])
def test_other_xml(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("<html><body/></html>")
    refused(
        tmp_path / name, "is no Mitsuba scene|is no SDFormat|cannot be read as a COLLADA|no scene"
    )


NOT_FINITE = np.array([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]], "<f4").tobytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"asset": None}, "`asset` is missing"),
        ({"asset": {"version": "1.0"}, "meshes": {}}, "glTF version 1; only version 2 is read"),
        ({"accessors": 3}, "accessors should be a list of objects"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": -3, "type": "VEC3"}]},
         "count should be a whole number of at least 0; found -3"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC3"}]},
         "more than 2 GB are not read"),
        ({"accessors": [{"bufferView": 0, "componentType": 5121, "count": 10**9,
                         "type": "SCALAR"}]},
         "333,333,333 triangles; more than 20,000,000"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"}]},
         "an accessor ends at byte 72 of a bufferView of 36"),
        ({"accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}]}, "has no bufferView"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                         "sparse": {}}]}, "count should be a whole number"),
        ({"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                         "sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5121,
                         "byteOffset": 14}, "values": {"bufferView": 0}}}]}, "beyond its end"),
        ({"accessors": [{"bufferView": 0, "byteOffset": -12, "componentType": 5126, "count": 1,
                         "type": "VEC3"}]}, "byteOffset should be a whole number"),
        ({"bufferViews": [{"buffer": 0, "byteLength": -1}]}, "byteLength should be a whole number"),
        ({"bufferViews": [{"buffer": 7, "byteLength": 36}]}, "refers to buffer 7; there are 1"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 37}]}, "ends at byte 37 of 36"),
        ({"nodes": [{"mesh": 5}]}, "refers to mesh 5; there are 1"),
        ({"nodes": [{"mesh": -1}]}, "refers to mesh -1"),
        ({"nodes": [{"mesh": 0, "scale": [0, 1, 1]}]}, "a scale is zero"),
        ({"nodes": [{"mesh": 0, "scale": [1, 1]}]}, "node 0: cannot be read"),
        ({"nodes": [{"mesh": 0, "translation": [float("nan"), 0, 0]}]}, "not made of finite"),
        ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "its rotation is zero"),
        ({"scene": 4}, "refers to scene 4"),
        ({"nodes": [{}]}, "holds no triangles"),
        ({"buffers": [{"byteLength": 36, "uri": "https://x.org/a.bin"}]}, "on the network"),
        ({"buffers": [{"byteLength": 36, "uri": "../a.bin"}]}, "lies outside the folders"),
        ({"buffers": [{"byteLength": 36, "uri": "%2e%2e/a.bin"}]}, "lies outside the folders"),
        ({"buffers": [{"byteLength": 36, "uri": "/etc/hostname"}]}, "lies outside the folders"),
        ({"buffers": [{"byteLength": 36, "uri": "gone.bin"}]}, "no file 'gone.bin'; searched"),
        ({"buffers": [{"byteLength": 36, "uri": "a\0b"}]}, "no usable path"),
        ({"extensionsRequired": ["KHR_new"]}, "needs the extension KHR_new, which is not"),
    ],
)  # fmt: skip
def test_damaged_glb(tmp_path: Path, changes: dict, message: str) -> None:
    (tmp_path / "a.glb").write_bytes(glb(triangle_header(**changes), TRIANGLE))
    refused(tmp_path / "a.glb", message)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (glb_of_text(b'{"asset": '), "cannot be read as a GLB file: no valid JSON in line 1"),
        (glb_of_text(b"[" * 100_000), "cannot be read as a GLB file"),
        (glb_of_text(b"\xff\xfe{}"), "cannot be read as a GLB file"),
        (glb_of_text(b"[1, 2]"), "is no glTF"),
        (glb(triangle_header(), TRIANGLE)[:-20], "the file ends early"),
        (b"glTF" + struct.pack("<4I", 1, 100, 10, 0) + bytes(100), "glTF version 1"),
        (glb(triangle_header(), NOT_FINITE), "vertices that are not finite"),
        (glb(triangle_header(), bytes(36)), "has no area"),
    ],
)
def test_damaged_glb_bytes(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.glb").write_bytes(data)
    refused(tmp_path / "a.glb", message)


PLY = (
    "ply\nformat ascii 1.0\nelement vertex {}\n"
    "property float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.ply", PLY.format(3, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "vertex not in the file"),
        ("a.ply", PLY.format(3, 1) + "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n", "not finite"),
        ("a.ply", PLY.format(3, 1) + "0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n", "has no area"),
        ("a.ply", PLY.format(3, 0) + "0 0 0\n1 0 0\n2 0 0\n", "holds no triangles|is empty"),
        ("a.ply", PLY.format(10**12, 1), "more than 60,000,000 are not read"),
        ("a.ply", PLY.format(3, 10**12), "more than 60,000,000 are not read"),
        ("a.ply", PLY.format(3, 1) + "0 0 0\n", "cannot be read as PLY|is empty"),
        ("a.ply", "ply\nformat ascii 1.0\n", "cannot be read as PLY"),
        ("a.ply", PLY.format(3, 2) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "1 of 2 faces|as PLY"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read as OBJ|not in the file"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n", "cannot be read as OBJ"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\nv 5 5 5\n", "v -4, but 3 are before"),
        ("a.obj", "v 0 0 0\n", "holds no triangles"),
        ("a.obj", "v 0\nv 1\nv 2\nf 1 2 3\n", "not triangles in 3-D"),
        ("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 z\n"
                  "vertex 0 1 0\nendloop\nendfacet\nendsolid\n", "cannot be read as STL"),
    ],
)  # fmt: skip
def test_damaged_meshes(tmp_path: Path, name: str, text: str, message: str) -> None:
    (tmp_path / name).write_text(text)
    refused(tmp_path / name, message)


def test_negative_indices_after_all_vertices_count_from_the_end(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n")
    assert taken(tmp_path / "a.obj").triangles == 1


def test_stl_that_is_cut_off(tmp_path: Path) -> None:
    tetrahedron().export(tmp_path / "a.stl")
    (tmp_path / "a.stl").write_bytes((tmp_path / "a.stl").read_bytes()[:-10])
    refused(tmp_path / "a.stl", "4 triangles need 284 bytes; the file has 274")


def test_buffers_count_together(tmp_path: Path, monkeypatch) -> None:
    """One file under many names, as `./a` and `././a`, would fill the memory."""
    monkeypatch.setattr("spisim_formats.gltf.buffers.MAX_FILE_BYTES", 100)
    (tmp_path / "a.bin").write_bytes(TRIANGLE)
    buffers = [{"byteLength": 36, "uri": "./" * i + "a.bin"} for i in range(3)]
    views = [{"buffer": i, "byteLength": 36} for i in range(3)]
    rows = [{"bufferView": i, "componentType": 5126, "count": 2, "type": "VEC3"} for i in range(3)]
    meshes = [{"primitives": [{"attributes": {"POSITION": i}}]} for i in range(3)]
    header = triangle_header(buffers=buffers, bufferViews=views, accessors=rows, meshes=meshes)
    header |= {"nodes": [{"mesh": i} for i in range(3)], "scenes": [{"nodes": [0, 1, 2]}]}
    (tmp_path / "a.gltf").write_text(json.dumps(header))
    refused(tmp_path / "a.gltf", "its buffers hold more than 2 GB together")


@pytest.mark.parametrize("name", ["a.sdf", "a.xml"])
def test_mesh_files_count_together(tmp_path: Path, name: str, monkeypatch) -> None:
    monkeypatch.setattr("spisim.scene.shapes.MAX_TRIANGLES", 10)
    shapes, visuals = "", ""
    for i in range(3):
        tetrahedron().export(tmp_path / f"{i}.ply")
        shapes += f'<shape type="ply"><string name="filename" value="{i}.ply"/></shape>'
        geometry = f"<geometry><mesh><uri>{i}.ply</uri></mesh></geometry>"
        visuals += f'<visual name="{i}">{geometry}</visual>'
    text = {
        "a.xml": f'<scene version="3.0.0">{shapes}</scene>',
        "a.sdf": '<sdf version="1.9"><model name="m"><link name="l">'
        f"{visuals}</link></model></sdf>",
    }
    (tmp_path / name).write_text(text[name])
    refused(tmp_path / name, "12 triangles, instances counted; more than 10")


def test_instances_count_as_triangles(tmp_path: Path) -> None:
    """A small file of many copies of a ball would fill the memory."""
    ball = trimesh.creation.icosphere(5)
    scene = trimesh.Scene()
    scene.geometry["ball"] = ball
    for i in range(1100):
        scene.graph.update(f"n{i}", geometry="ball", matrix=np.eye(4))
    scene.export(tmp_path / "a.glb")
    refused(tmp_path / "a.glb", "22,528,000 triangles, instances counted")


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('url="#g"', 'url="#h"', "geometry '#h' is not in the file"),
        ("0 2 1 0 1 3", "0 2 1 0 1 9", "geometry 'g': Indexes .* beyond the limits"),
        ("0 0 0 1000", "0 0 0 NaN", "not finite"),
        ('meter="0.001"', 'meter="0"', "unit"),
        ('meter="0.001"', 'meter="-1"', "unit"),
    ],
)
def test_damaged_collada(tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in collada()
    (tmp_path / "a.dae").write_text(collada().replace(before, after))
    refused(tmp_path / "a.dae", message)


def test_links_out_of_the_folder(tmp_path: Path) -> None:
    (tmp_path / "secret.bin").write_bytes(TRIANGLE)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link.bin").symlink_to(tmp_path / "secret.bin")
    header = triangle_header(buffers=[{"byteLength": 36, "uri": "link.bin"}])
    (tmp_path / "in" / "a.glb").write_bytes(glb(header))
    refused(tmp_path / "in" / "a.glb", "lies outside the folders")
    assert taken(tmp_path / "in" / "a.glb", model_path=(tmp_path,)).triangles == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"units": "mn"}, "--units: unknown unit 'mn': did you mean 'm'"),
        ({"up": "w"}, "--up: unknown axis 'w': allowed: x, y, z"),
        ({"scale": 0.0}, "--scale should be a positive number"),
        ({"scale": float("nan")}, "--scale should be a positive number"),
        ({"model_path": (Path("/nowhere"),)}, "--model-path /nowhere: no such folder"),
        ({"look_at_m": (0, 0, 0)}, "--look-at goes with --drone"),
        ({"position_m": (0, 0, 9), "look_at_m": (0, 0, 9)}, "look_at_m should differ"),
        ({"position_m": (0.2, 0.2, 9), "look_at_m": (0.2, 0.2, 0)}, "along the line of sight"),
        ({"position_m": (float("inf"), 0, 9)}, "finite"),
        ({"position_m": (0.1, 0.1, 0.1)}, "scene.yaml: drone.position_m: .* is inside object"),
    ],
)  # fmt: skip
def test_options(tmp_path: Path, options: dict, message: str) -> None:
    tetrahedron().export(tmp_path / "a.ply")
    refused(tmp_path / "a.ply", message, **options)


def test_older_files_stay_unless_they_may_go(tmp_path: Path) -> None:
    tetrahedron().export(tmp_path / "a.ply")
    taken(tmp_path / "a.ply")
    scene_file = tmp_path / "taken" / "scene.yaml"
    mesh = tmp_path / "taken" / "scene-meshes" / "a.ply"
    first = scene_file.read_bytes(), mesh.read_bytes()
    refused(tmp_path / "a.ply", "scene.yaml exists; --overwrite replaces it")
    refused(tmp_path / "a.ply", "is inside object", overwrite=True, position_m=(0.1, 0.1, 0.1))
    assert (scene_file.read_bytes(), mesh.read_bytes()) == first
    taken(tmp_path / "a.ply", overwrite=True, scale=2)
    assert (scene_file.read_bytes(), mesh.read_bytes()) != first
    left = sorted(path.name for path in (tmp_path / "taken").iterdir())
    assert left == ["scene-meshes", "scene.yaml"]
    scene_file.unlink()
    refused(tmp_path / "a.ply", "scene-meshes exists; --overwrite replaces it")


def test_failure_while_putting_in_place_restores(tmp_path: Path, monkeypatch) -> None:
    """Ctrl-C between the two renames leaves the older files."""
    tetrahedron().export(tmp_path / "a.ply")
    taken(tmp_path / "a.ply")
    before = {p: p.read_bytes() for p in (tmp_path / "taken").rglob("*") if p.is_file()}
    rename = Path.rename

    def interrupted(self: Path, target: Path) -> Path:
        if self.name == "scene.yaml" and ".tmp" in str(self.parent):
            raise KeyboardInterrupt
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        taken(tmp_path / "a.ply", overwrite=True, scale=2)
    assert {p: p.read_bytes() for p in (tmp_path / "taken").rglob("*") if p.is_file()} == before


@pytest.mark.parametrize("name", ["scene.txt", "scene"])
def test_output_needs_the_suffix_of_a_scene(tmp_path: Path, name: str) -> None:
    tetrahedron().export(tmp_path / "a.ply")
    with pytest.raises(InputError, match=r"scene.*: allowed: \.yaml, \.yml"):
        import_scene(tmp_path / "a.ply", tmp_path / name, Options())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable(tmp_path: Path) -> None:
    tetrahedron().export(tmp_path / "a.ply")
    (tmp_path / "a.ply").chmod(0)
    refused(tmp_path / "a.ply", "cannot be read")
