"""Mitsuba's `serialized` meshes: triangles of one of the shapes in a file.

Format: https://mitsuba.readthedocs.io/en/stable/src/generated/plugins_shapes.html, "serialized".
A header of two numbers, a zlib stream per shape, and where each begins at the end of the file.
"""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import DTypeLike, NDArray

from reconstruction.base.errors import InputError
from spisim.scene.shapes import check_mesh, check_triangles
from spisim_formats.library.content import readable
from spisim_formats.library.files import MAX_FILE_BYTES, quoted, read_bytes

MAGIC = 0x041C
VERSIONS = (3, 4)
NORMALS, COORDINATES, COLORS, DOUBLE = 0x0001, 0x0002, 0x0008, 0x2000


def read_serialized(path: Path, index: int) -> tuple[str, trimesh.Trimesh]:
    """Name and mesh of a shape by its index; InputError for what is damaged or not there."""
    data = read_bytes(path)
    with readable(str(path), "Mitsuba's serialized format"):
        magic, version = struct.unpack_from("<HH", data)
        if magic != MAGIC or version not in VERSIONS:
            raise InputError(f"{path}: is no serialized mesh of Mitsuba, version 3 or 4")
        starts = _starts(data, version)
        if not 0 <= index < len(starts):
            raise InputError(f"{path}: has no shape_index {index}; there are {len(starts)}")
        inflate = zlib.decompressobj()
        text = inflate.decompress(data[starts[index] + 4 :], MAX_FILE_BYTES)
        if not inflate.eof:
            raise InputError(f"{path}: shape {index} is cut off, or more than 2 GB")
        return _mesh(_Fields(text), version, path)


def _starts(data: bytes, version: int) -> tuple[int, ...]:
    (count,) = struct.unpack_from("<I", data, len(data) - 4)
    width = 8 if version >= 4 else 4
    if not 0 < count <= (len(data) - 4) // width:
        raise InputError(f"the dictionary at its end tells of {count:,} shapes")
    kind = f"<{count}{'Q' if width == 8 else 'I'}"
    starts: tuple[int, ...] = struct.unpack_from(kind, data, len(data) - 4 - count * width)
    return starts


@dataclass
class _Fields:
    """Numbers, one after the other."""

    text: bytes
    position: int = 0

    def take(self, kind: DTypeLike, count: int) -> NDArray[np.generic]:
        result = np.frombuffer(self.text, kind, count, self.position)
        self.position += result.nbytes
        return result


def _mesh(fields: _Fields, version: int, path: Path) -> tuple[str, trimesh.Trimesh]:
    (flags,) = fields.take("<u4", 1)
    name = path.stem
    if version >= 4:
        stop = fields.text.index(b"\0", fields.position)
        name = fields.text[fields.position : stop].decode("utf-8", errors="replace") or name
        fields.position = stop + 1
    vertices, triangles = (int(count) for count in fields.take("<u8", 2))
    check_triangles(triangles)
    check_triangles(vertices // 3)
    number = "<f8" if int(flags) & DOUBLE else "<f4"
    points = fields.take(number, 3 * vertices).reshape(-1, 3)
    uv = None
    if int(flags) & NORMALS:
        fields.take(number, 3 * vertices)
    if int(flags) & COORDINATES:
        uv = fields.take(number, 2 * vertices).reshape(-1, 2)
    if int(flags) & COLORS:
        fields.take(number, 3 * vertices)
    faces = fields.take("<u4", 3 * triangles).reshape(-1, 3).astype(np.int64)
    visual = None if uv is None else trimesh.visual.TextureVisuals(uv=uv)
    mesh = trimesh.Trimesh(points, faces, process=False, visual=visual)
    check_mesh(mesh, quoted(name))
    return name, mesh
