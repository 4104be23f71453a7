"""Import of meshes in Mitsuba's serialized format."""

import struct
import zlib
from pathlib import Path

import pytest
import trimesh

from foreign import assert_same, taken, tetrahedron, written
from mitsuba_scenes import scene, shape
from reconstruction.base.errors import InputError


def serialized(*meshes: trimesh.Trimesh, version: int = 4, double: bool = False) -> bytes:
    """Mitsuba's format, with texture coordinates."""
    number = "<f8" if double else "<f4"
    data, starts = b"", []
    for mesh in meshes:
        name = b"part\0" if version == 4 else b""
        rows = struct.pack("<I", 0x0002 | (0x2000 if double else 0x1000)) + name
        rows += struct.pack("<2Q", len(mesh.vertices), len(mesh.faces))
        rows += mesh.vertices.astype(number).tobytes()
        rows += mesh.vertices[:, :2].astype(number).tobytes() + mesh.faces.astype("<u4").tobytes()
        starts.append(len(data))
        data += struct.pack("<HH", 0x041C, version) + zlib.compress(rows)
    kind = "Q" if version == 4 else "I"
    return data + struct.pack(f"<{len(starts)}{kind}I", *starts, len(starts))


@pytest.mark.parametrize(("version", "double"), [(3, False), (4, False), (4, True)])
def test_serialized(tmp_path: Path, version: int, double: bool) -> None:
    meshes = trimesh.creation.box((1, 1, 1)), tetrahedron()
    (tmp_path / "a.serialized").write_bytes(serialized(*meshes, version=version, double=double))
    body = shape(
        "serialized",
        '<string name="filename" value="a.serialized"/><integer name="shape_index" value="1"/>',
    )
    assert_same(written(taken(scene(tmp_path / "a.xml", body))), tetrahedron())


@pytest.mark.parametrize(
    ("data", "index", "message"),
    [
        (serialized(tetrahedron()), 1, "has no shape_index 1; there are 1"),
        (serialized(tetrahedron()), -1, "has no shape_index -1"),
        (serialized(tetrahedron())[:-40] + bytes(12), 0, "tells of 0 shapes"),
        (b"\x1c\x04\x04\x00" + b"\xff" * 30, 0, "tells of 4,294,967,295 shapes"),
        (b"ply", 0, "cannot be read"),
        (b"abcdefgh" * 9, 0, "is no serialized mesh"),
        (
            b"\x1c\x04\x04\x00"
            + zlib.compress(struct.pack("<I", 0) + b"\0" + struct.pack("<2Q", 3, 2**40))
            + struct.pack("<QI", 0, 1),
            0,
            "triangles",
        ),
    ],
)
def test_serialized_that_is_refused(tmp_path: Path, data: bytes, index: int, message: str) -> None:
    (tmp_path / "a.serialized").write_bytes(data)
    body = shape(
        "serialized",
        '<string name="filename" value="a.serialized"/>'
        f'<integer name="shape_index" value="{index}"/>',
    )
    with pytest.raises(InputError, match=message):
        taken(scene(tmp_path / "a.xml", body))
