"""What the grammars of meshes allow, and concave polygons in every format, imported or not."""

import os
import re
import struct
from pathlib import Path

import numpy as np
import pytest
import yaml

from foreign import collada, taken, written
from reconstruction.base.errors import InputError
from spisim.scene.model import SceneWarning
from spisim.scene.shapes import load_mesh
from spisim_formats import import_scene

NOTCHED = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (1.5, 0.5, 0), (0, 3, 0)]
WALL = [(0, 0, 0), (4, 0, 0), (4, 3, 0), (0, 3, 0), (1, 2, 0), (1.25, 2, 0), (1.25, 1, 0),
        (1, 1, 0), (2, 2, 0), (2.25, 2, 0), (2.25, 1, 0), (2, 1, 0)]  # fmt: skip
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
SOLID = (
    b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    b"endloop\nendfacet\nendsolid a\n"
)
BINARY_STL = (
    b"solid as some programs begin".ljust(80)
    + struct.pack("<I", 1)
    + struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
)


def rows(points: list[tuple[float, ...]], start: str = "") -> str:
    return "".join(f"{start}{' '.join(map(str, point))}\n" for point in points)


def ply(form: str, faces: list[list[int]], *, comment: bytes = b"") -> bytes:
    """A notched plate and more, with a colour at each face."""
    head = (
        f"ply\nformat {form} 1.0\n".encode() + comment + b"element vertex 5\nproperty float x\n"
        b"property float y\nproperty float z\nelement face %d\nproperty uchar red\n"
        b"property list uchar int vertex_indices\nend_header\n" % len(faces)
    )
    if form == "ascii":
        lines = rows(NOTCHED) + rows([(7, len(face), *face) for face in faces])
        return head + lines.encode()
    order = "<" if "little" in form else ">"
    body = b"".join(struct.pack(f"{order}3f", *point) for point in NOTCHED)
    for face in faces:
        body += struct.pack(f"{order}BB{len(face)}i", 7, len(face), *face)
    return head + body


PLATE = [[0, 1, 2, 3, 4]]
#: The same as faces of four and three corners.
PIECES = [[0, 1, 2, 3], [0, 3, 4]]
AREAS = {
    "plate.obj": (rows(NOTCHED, "v ") + "f 1 2 3 4 5\n").encode(),
    "texture.obj": (
        rows(NOTCHED, "v ") + "vt 0 0\nvt 1 0\nvt 1 1\nvt .5 .2\nvt 0 1\nf 1/1 2/2 3/3 4/4 5/5\n"
    ).encode(),
    "pieces.obj": (rows(NOTCHED, "v ") + "f 2 3 4 1\nf 1 4 5\n").encode(),
    "plate.off": ("OFF # a plate\n5 1 0\n" + rows(NOTCHED) + "5 0 1 2 3 4 255 0 0\n").encode(),
    "line.off": (
        "COFF 5 1 0\n" + rows([(*p, 1, 0, 0, 1) for p in NOTCHED]) + "5 0 1 2 3 4\n"
    ).encode(),
    "text.ply": ply("ascii", PLATE),
    "little.ply": ply("binary_little_endian", PLATE),
    "big.ply": ply("binary_big_endian", PLATE),
    "pieces.ply": ply("binary_little_endian", PIECES),
    "reversed.ply": ply("binary_big_endian", PIECES[::-1]),
    "latin.ply": ply("ascii", PLATE, comment="comment Säule\n".encode("latin-1")),
}


@pytest.mark.parametrize("name", AREAS)
def test_concave_polygons_are_not_folded_over(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(AREAS[name])
    for mesh in (load_mesh(path), written(taken(path))):
        assert mesh.area == pytest.approx(5.25, 1e-6)
        assert len(mesh.faces) == 3
        assert (mesh.triangles_cross[:, 2] > 0).all()


def test_coordinates_of_pictures_stay_with_their_corners(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_bytes(AREAS["texture.obj"])
    mesh = load_mesh(path)
    np.testing.assert_allclose(3 * mesh.visual.uv[:, [0]], mesh.vertices[:, [0]], atol=1e-6)


POLYLIST = "<polylist count='1'><input semantic='VERTEX' source='#v' offset='0'/>{}</polylist>"
POLYGONS = "<polygons count='1'><input semantic='VERTEX' source='#v' offset='0'/>{}</polygons>"


@pytest.mark.parametrize(
    ("points", "element", "area"),
    [
        (NOTCHED, POLYLIST.format("<vcount>5</vcount><p>0 1 2 3 4</p>"), 5.25),
        (NOTCHED, POLYGONS.format("<p>0 1 2 3 4</p>"), 5.25),
        (WALL, POLYGONS.format("<ph><p>0 1 2 3</p><h>4 5 6 7</h><h>8 9 10 11</h></ph>"), 11.5),
    ],
    ids=["polylist", "polygons", "holes"],
)
def test_polygons_of_collada(tmp_path: Path, points, element: str, area: float) -> None:
    text = collada("<up_axis>Z_UP</up_axis>")
    text = re.sub(r"<triangles.*?</triangles>", element, text, flags=re.S)
    numbers = " ".join(str(x) for point in points for x in point)
    text = re.sub(r"(<float_array[^>]*>)[^<]*", rf"\g<1>{numbers}", text)
    text = text.replace('count="12"', f'count="{3 * len(points)}"')
    text = text.replace('count="4" stride', f'count="{len(points)}" stride')
    (tmp_path / "a.dae").write_text(text)
    report = taken(tmp_path / "a.dae")
    assert written(report).area == pytest.approx(2 * area)  # it is there twice
    assert report.notes == ()


USD = """#usda 1.0
(metersPerUnit = 1
 upAxis = "Z")
def Mesh "plate"
{{
    int[] faceVertexCounts = {counts}
    int[] faceVertexIndices = {corners}
    point3f[] points{points}
    {more}
}}
"""


def stage(path: Path, counts: list[int], corners: list[int], points: str, more: str = "") -> Path:
    pytest.importorskip("pxr")
    path.write_text(USD.format(counts=counts, corners=corners, points=points, more=more))
    return path


def test_polygons_of_openusd(tmp_path: Path) -> None:
    file = stage(tmp_path / "a.usda", [5], [0, 1, 2, 3, 4], f" = {NOTCHED}")
    assert written(taken(file)).area == pytest.approx(5.25)


def test_faces_of_openusd_that_are_holes_are_not_there(tmp_path: Path) -> None:
    file = stage(
        tmp_path / "a.usda", [3, 3], [0, 1, 3, 1, 2, 3], f" = {NOTCHED}", "int[] holeIndices = [1]"
    )
    assert written(taken(file)).area == pytest.approx(0.75)


def test_what_openusd_has_at_times_alone_is_taken_at_the_earliest(tmp_path: Path) -> None:
    samples = f".timeSamples = {{ 7: {[(9, 9, 9)] * 5}, 3: {NOTCHED} }}"
    more = (
        "double3 xformOp:translate.timeSamples = { 1: (5, 0, 0), 9: (7, 0, 0) }\n"
        "double xformOp:rotateZ = 0\ndouble xformOp:rotateZ.timeSamples = { 1: 90 }\n"
        'token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateZ"]'
    )
    report = taken(stage(tmp_path / "a.usda", [5], [0, 1, 2, 3, 4], samples, more))
    np.testing.assert_allclose(report.bounds_m, [[5, 0, 0], [8, 3, 0]], atol=1e-6)
    settled, unread = report.notes
    assert "earliest time: 2, first '/plate." in settled
    assert unread == "a.usda: not read of Mesh: xformOp:rotateZ in time"


INSTANCES = """#usda 1.0
(metersPerUnit = 1
 upAxis = "Z")
def "one" (
    instanceable = true
    prepend references = @b.usda@
)
{{
}}
def PointInstancer "many"
{{
    point3f[] positions.timeSamples = {samples}
    int[] protoIndices = [0]
    rel prototypes = </many/it>
    def Cube "it"
    {{
        double size = 1
    }}
}}
"""


def test_instances_of_openusd_at_times_alone(tmp_path: Path) -> None:
    inner = stage(tmp_path / "b.usda", [5], [0, 1, 2, 3, 4], f".timeSamples = {{ 3: {NOTCHED} }}")
    inner.write_text(inner.read_text().replace("upAxis", 'defaultPrim = "plate"\n upAxis'))
    (tmp_path / "a.usda").write_text(
        INSTANCES.format(samples="{ -5: [(1, 0, 0)], 5: [(9, 0, 0)] }")
    )
    report = taken(tmp_path / "a.usda")
    np.testing.assert_allclose(report.bounds_m, [[0, -0.5, -0.5], [3, 3, 0.5]], atol=1e-6)


VALID = {
    "blank.stl": b" " + SOLID,
    "newline.stl": b"\r\n" + SOLID,
    "mark.stl": b"\xef\xbb\xbf" + SOLID,
    "header.stl": BINARY_STL,
    "comments.obj": (
        b"v 0 0 0 # one\nv 1 0 0#\nv 0 1 0\n# C:\\models\\\n# f 0 0 0\nf 1 2 3 # f 1 1 1\n"
    ),
    "tabs.obj": TRIANGLE.replace(" ", "\t").encode() + b"f\t1\t2\t3\n",
    "leading.obj": b"  v 0 0 0\n\tv 1 0 0\n  v 0 1 0\n  f 1 2 3\n",
    "continued.obj": TRIANGLE.encode() + b"f 1 2 \\ \n 3\n",
    "lines.obj": TRIANGLE.replace("\n", "\r").encode() + b"f 1 2 3\r",
    "mark.obj": b"\xef\xbb\xbf" + TRIANGLE.encode() + b"f 1 2 3\n",
    "names.obj": b"o S\xe4ule\n" + TRIANGLE.encode() + b"f 1 2 3\n",
    "relative.obj": (TRIANGLE + "vt 0 0\nf -3/-1 -2/-1 -1/-1\nv 5 5 5\n").encode(),
}


@pytest.mark.parametrize("name", VALID)
def test_one_triangle_in_many_ways(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(VALID[name])
    for mesh in (load_mesh(path), written(taken(path))):
        np.testing.assert_allclose(mesh.triangles, [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]])


def test_indices_back_from_each_line(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    higher = TRIANGLE.replace(" 0\n", " 5\n")
    path.write_text(f"{TRIANGLE}f -3 -2 -1\n{higher}f -3 -2 -1\n")
    for mesh in (load_mesh(path), written(taken(path))):
        assert sorted(mesh.triangles_center[:, 2]) == [0, 5]
    path.write_text(f"{TRIANGLE}f -4 -2 -1\n")
    with pytest.raises(InputError, match=r"a\.obj.*refers to v -4, but 3 are before it"):
        load_mesh(path)


@pytest.mark.parametrize("surplus", [-1, 50, 500])
def test_a_binary_stl_of_another_length_is_refused(tmp_path: Path, surplus: int) -> None:
    path = tmp_path / "a.stl"
    path.write_bytes((BINARY_STL + bytes(500))[: len(BINARY_STL) + surplus])
    for read in (load_mesh, taken):
        with pytest.raises(InputError, match="1 triangles need 134 bytes; the file has"):
            read(path)


def test_loops_of_stl_have_three_corners(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    path.write_bytes(SOLID.replace(b"endloop", b"vertex 5 5 0\nendloop"))
    for read in (load_mesh, taken):
        with pytest.raises(InputError, match="three corners each"):
            read(path)


def test_bytes_after_the_last_triangle_are_named(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    path.write_bytes(BINARY_STL + b"\n")
    with pytest.warns(SceneWarning, match="1 bytes after"):
        assert len(load_mesh(path).faces) == 1
    assert taken(path).notes == ("a.stl: 1 bytes after the last triangle are left out",)


@pytest.mark.parametrize(
    ("text", "materials"),
    [
        ("mtllib a.mtl b.mtl\n{}usemtl lack\nf 1 2 3\n", {"lack"}),
        ("mtllib\tmy b.mtl\n{}usemtl\tlack # dark\nf 1 2 3\n", {"lack"}),
        ("  mtllib B.MTL # of it\n{}  usemtl lack\n  f 1 2 3\n", {"lack"}),
        ("mtllib a.mtl\n{}usemtl Material #2\nf 1 2 3\nusemtl Material #3\nf 1 3 2\n",
         {"Material #2", "Material #3"}),
    ],
)  # fmt: skip
def test_materials_of_obj(tmp_path: Path, text: str, materials: set[str]) -> None:
    (tmp_path / "a.mtl").write_text("newmtl Material #2\nKd 0 0 0\nnewmtl Material #3\nKd 0 0 0\n")
    for name in ("b.mtl", "my b.mtl"):
        (tmp_path / name).write_text("newmtl lack\n\tKd 0 0 0 # black\n")
    (tmp_path / "a.obj").write_text(text.format(TRIANGLE))
    report = taken(tmp_path / "a.obj")
    assert {match.source for match, _ in report.materials} == materials
    assert {match.material for match, _ in report.materials} == {"paint-black"}
    assert report.notes == ()


def test_polygons_that_cross_themselves_are_a_note_or_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 4\nf 1 3 2\n")
    with pytest.warns(SceneWarning, match=r"'a\.obj': 1 of 1 polygons cross themselves"):
        load_mesh(path)
    (note,) = taken(path).notes
    assert note.startswith("a.obj: 1 of 1 polygons cross themselves or have no area")


def test_names_in_latin_1(tmp_path: Path) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/b\xe9ton.obj"))
    path.write_text(f"mtllib b\u00e9ton.mtl\n{TRIANGLE}usemtl lack\nf 1 2 3\n")
    path.with_suffix(".mtl").write_text("newmtl lack\nKd 0 0 0\n")
    report = taken(path)
    fields = yaml.safe_load(report.written.scene_file.read_text(encoding="utf-8"))
    assert fields["description"] == "imported from b\u00e9ton.obj"
    assert [match.material for match, _ in report.materials] == ["paint-black"]
    with pytest.raises(InputError, match="its name should be UTF-8"):
        import_scene(path, path.with_suffix(".yaml"))
