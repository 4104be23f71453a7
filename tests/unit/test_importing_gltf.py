"""Numbers of glTF files: strips, fans, sparse, normalized, compressed, instances, coordinates."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from foreign import Y_UP, corners, glb, taken, tetrahedron, triangle_header, written
from reconstruction.base.errors import InputError
from spisim.scene.shapes import texture_coordinates

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "<f4")


def file(path: Path, *arrays: np.ndarray, **changes) -> Path:
    """A GLB file whose accessors are arrays, the first the positions of its mesh."""
    kinds = {"f4": 5126, "u1": 5121, "u2": 5123, "u4": 5125, "i2": 5122}
    views, accessors, data = [], [], b""
    for array in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        width = 1 if array.ndim == 1 else array.shape[1]
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": kinds[array.dtype.str[1:]],
                "count": len(array),
                "type": "SCALAR" if width == 1 else f"VEC{width}",
            }
        )
        data += array.tobytes()
    header = triangle_header(
        bufferViews=views, accessors=accessors, buffers=[{"byteLength": len(data)}]
    )
    for name, change in changes.items():
        if name == "primitive":
            header["meshes"][0]["primitives"][0] |= change
        elif name == "accessor":
            accessors[0] |= change
        else:
            header[name] = change
    path.write_bytes(glb(header, data))
    return path


def assert_same_triangles(got: trimesh.Trimesh, expected: trimesh.Trimesh) -> None:
    assert len(got.faces) == len(expected.faces)
    np.testing.assert_allclose(corners(got), corners(expected), rtol=0, atol=1e-6)


def placed(points: np.ndarray, faces: list) -> trimesh.Trimesh:
    return trimesh.Trimesh(points, faces, process=False).apply_transform(Y_UP)


@pytest.mark.parametrize(
    ("mode", "order", "faces"),
    [
        (5, [0, 1, 2, 3], [[0, 1, 2], [2, 1, 3]]),
        (5, [0, 1, 2, 2, 3, 3, 1, 0], [[0, 1, 2], [1, 3, 0]]),  # two strips, joined by repeats
        (6, [0, 1, 3, 2], [[0, 1, 3], [0, 3, 2]]),
        (4, [0, 1, 2, 1, 3], [[0, 1, 2]]),  # the rest is cut off
    ],
)
def test_strips_and_fans(tmp_path: Path, mode: int, order: list, faces: list) -> None:
    """As the specification counts them, so that all face as one."""
    indices = np.array(order, "<u2")
    path = file(tmp_path / "a.glb", SQUARE, indices, primitive={"mode": mode, "indices": 1})
    got = written(taken(path))
    expected = placed(SQUARE, faces)
    assert_same_triangles(got, expected)
    facing, expected_facing = got.face_normals.sum(axis=0), expected.face_normals.sum(axis=0)
    np.testing.assert_allclose(facing, expected_facing, atol=1e-6)


def test_normalized_integers(tmp_path: Path) -> None:
    points = np.round(SQUARE[:3] * 32767).astype("<i2")
    points = np.ascontiguousarray(np.pad(points, ((0, 0), (0, 1))))  # aligned to four bytes
    path = file(
        tmp_path / "a.glb",
        points,
        accessor={"type": "VEC3", "normalized": True},
        bufferViews=[{"buffer": 0, "byteLength": 24, "byteStride": 8}],
    )
    assert_same_triangles(written(taken(path)), placed(SQUARE[:3], [[0, 1, 2]]))


@pytest.mark.parametrize("based", [True, False])
def test_sparse_accessors(tmp_path: Path, based: bool) -> None:
    """Some values are others than the base, which is zero without a view."""
    base = np.zeros((3, 3), "<f4") if not based else SQUARE[:3] + np.array([0, 0, 5])
    base = base.astype("<f4")
    numbers, values = np.array([1, 2], "<u2"), SQUARE[1:3]
    sparse = {
        "count": 2,
        "indices": {"bufferView": 1, "componentType": 5123},
        "values": {"bufferView": 2},
    }
    path = file(tmp_path / "a.glb", base, numbers, values, accessor={"sparse": sparse})
    expected = base.copy()
    expected[1:] = values
    assert_same_triangles(written(taken(path)), placed(expected, [[0, 1, 2]]))


def test_instances(tmp_path: Path) -> None:
    shifts = np.array([[0, 0, 0], [5, 0, 0]], "<f4")
    turns = np.array([[0, 0, 0, 1], [0, 0, np.sqrt(0.5), np.sqrt(0.5)]], "<f4")
    copies = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1, "ROTATION": 2}}}
    path = file(
        tmp_path / "a.glb", SQUARE[:3], shifts, turns, nodes=[{"mesh": 0, "extensions": copies}]
    )
    second = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])
    second[0, 3] = 5
    triangle = trimesh.Trimesh(SQUARE[:3], [[0, 1, 2]], process=False)
    both = [triangle, triangle.copy().apply_transform(second)]
    expected = trimesh.util.concatenate(both).apply_transform(Y_UP)
    assert_same_triangles(written(taken(path)), expected)


def test_texture_coordinates_are_kept(tmp_path: Path) -> None:
    """In glTF v goes down."""
    uv = np.array([[0, 1], [1, 1], [0, 0.25]], "<f4")
    attributes = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}
    path = file(tmp_path / "a.glb", SQUARE[:3], uv, primitive=attributes)
    (thing,) = taken(path).written.scene.objects
    np.testing.assert_allclose(texture_coordinates(thing.mesh), [[0, 0], [1, 0], [0, 0.75]])


def test_texture_coordinates_of_obj(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0\nvt 1 0\nvt 0 0.75\nf 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(text)
    (thing,) = taken(tmp_path / "a.obj").written.scene.objects
    np.testing.assert_allclose(texture_coordinates(thing.mesh), [[0.5, 0], [1, 0], [0, 0.75]])


def draco_file(path: Path, data: bytes) -> Path:
    name = "KHR_draco_mesh_compression"
    packed = {"bufferView": 0, "attributes": {"POSITION": 0}}
    return file(
        path,
        np.frombuffer(data, "u1"),
        accessors=[{"componentType": 5126, "count": 4, "type": "VEC3"}],
        extensionsRequired=[name],
        primitive={"extensions": {name: packed}},
    )


def test_draco(tmp_path: Path) -> None:
    encoder = pytest.importorskip("DracoPy")
    mesh = tetrahedron()
    data = encoder.encode(mesh.vertices.astype("<f4"), mesh.faces, quantization_bits=20)
    got = written(taken(draco_file(tmp_path / "a.glb", data)))
    assert got.volume == pytest.approx(1, rel=1e-4)
    assert got.extents == pytest.approx([1, 3, 2], rel=1e-4)


def test_damaged_draco(tmp_path: Path) -> None:
    pytest.importorskip("DracoPy")
    with pytest.raises(InputError, match=r"mesh .*: cannot be read"):
        taken(draco_file(tmp_path / "a.glb", b"DRACO" + bytes(50)))


@pytest.mark.parametrize(("library", "extra"), [("DracoPy", "draco"), ("meshoptimizer", "meshopt")])
def test_compressed_without_the_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, library: str, extra: str
) -> None:
    monkeypatch.setitem(__import__("sys").modules, library, None)
    path = draco_file(tmp_path / "a.glb", bytes(64))
    if extra == "meshopt":
        name = "EXT_meshopt_compression"
        packed = {"buffer": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}
        views = [{"buffer": 0, "byteLength": 36, "extensions": {name: packed}}]
        path = file(tmp_path / "a.glb", SQUARE[:3], bufferViews=views, extensionsRequired=[name])
    with pytest.raises(InputError, match=rf"install `spisim\[{extra}\]`"):
        taken(path)


def test_meshopt(tmp_path: Path) -> None:
    encoder = pytest.importorskip("meshoptimizer")
    packed = np.frombuffer(encoder.encode_vertex_buffer(SQUARE[:3], 3, 12), "u1")
    name = "EXT_meshopt_compression"
    row = {"buffer": 0, "byteLength": len(packed), "byteStride": 12, "count": 3}
    views = [{"buffer": 1, "byteLength": 36, "extensions": {name: row | {"mode": "ATTRIBUTES"}}}]
    path = file(
        tmp_path / "a.glb",
        packed,
        bufferViews=views,
        buffers=[{"byteLength": len(packed)}, {"byteLength": 36}],
        accessors=[{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        extensionsRequired=[name],
    )
    assert_same_triangles(written(taken(path)), placed(SQUARE[:3], [[0, 1, 2]]))


def test_chunks_that_are_not_aligned(tmp_path: Path) -> None:
    text = glb(triangle_header(), SQUARE[:3].tobytes())
    (length,) = struct.unpack_from("<I", text, 12)
    header = text[20 : 20 + length].rstrip() + b" "
    chunks = struct.pack("<2I", len(header), 0x4E4F534A) + header + text[20 + length :]
    (tmp_path / "a.glb").write_bytes(b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks)
    assert_same_triangles(written(taken(tmp_path / "a.glb")), placed(SQUARE[:3], [[0, 1, 2]]))
