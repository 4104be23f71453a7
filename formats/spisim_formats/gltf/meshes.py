"""Meshes of a glTF file: triangles of its primitives, compressed by Draco or not."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.errors import InputError, LimitError
from spisim.scene.shapes import MAX_TRIANGLES, check_mesh
from spisim_formats.gltf.buffers import Buffers, at, library
from spisim_formats.library.content import Content, with_texture_coordinates
from spisim_formats.library.files import quoted

TRIANGLES, STRIP, FAN = 4, 5, 6
DRACO = "KHR_draco_mesh_compression"


@dataclass(frozen=True, eq=False)
class Primitive:
    """Triangles of one material, whose number in the file it is, or None.

    `colors` (v, 3 or 4) at vertices multiply its own, from 0 to 1.
    """

    name: str
    mesh: trimesh.Trimesh
    material: Any
    colors: NDArray[Any] | None = None


def read_mesh(
    row: dict[str, Any], number: int, weights: Any, buffers: Buffers, content: Content
) -> list[Primitive]:
    """Return a mesh's primitives of triangles, morphed by weights; notes what is left out."""
    name = row.get("name") or f"mesh {number}"
    primitives = []
    for primitive in row.get("primitives", []):
        with content.leaving_out(f"mesh {quoted(name)}"):
            if primitive.get("mode", TRIANGLES) not in (TRIANGLES, STRIP, FAN):
                content.note(f"mesh {quoted(name)}: points and lines are left out")
                continue
            mesh, colors = _mesh(primitive, buffers)
            mesh.vertices = mesh.vertices + _moves(primitive, weights, buffers)
            check_mesh(mesh, name)
            primitives.append(Primitive(name, mesh, primitive.get("material"), colors))
    return primitives


def _moves(primitive: dict[str, Any], weights: Any, buffers: Buffers) -> Any:
    """Return the shift of vertices (v, 3) by morph targets, or 0."""
    moves: Any = 0.0
    for target, weight in zip(primitive.get("targets", []), weights or (), strict=False):
        if weight and "POSITION" in target:
            moves = moves + float(weight) * buffers.accessor(target["POSITION"])
    return moves


def check_triangle_count(header: dict[str, Any]) -> None:
    """LimitError for more triangles than are read; damaged meshes raise when they are read."""
    count = 0
    for mesh in header.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            with suppress(AttributeError, InputError, KeyError, TypeError, ValueError):
                count += _triangles(primitive, header)
    if count > MAX_TRIANGLES:
        raise LimitError(f"{count:,} triangles; more than {MAX_TRIANGLES:,} are not read")


def _triangles(primitive: dict[str, Any], header: dict[str, Any]) -> int:
    accessors = header.get("accessors", [])
    index = primitive.get("indices", primitive["attributes"]["POSITION"])
    corners = int(at(accessors, index, "accessor")["count"])
    return corners // (3 if primitive.get("mode", TRIANGLES) == TRIANGLES else 1)


def _mesh(
    primitive: dict[str, Any], buffers: Buffers
) -> tuple[trimesh.Trimesh, NDArray[Any] | None]:
    """Return the triangles of a primitive, and colours at their vertices."""
    if DRACO in primitive.get("extensions", {}):
        return _draco_mesh(primitive["extensions"][DRACO], buffers)
    attributes = primitive["attributes"]
    points = buffers.accessor(attributes["POSITION"])
    if "indices" in primitive:
        corners = buffers.accessor(primitive["indices"])[:, 0].astype(np.int64)
    else:
        corners = np.arange(len(points))
    faces = _faces(corners, primitive.get("mode", TRIANGLES))
    mesh = trimesh.Trimesh(points, faces, process=False)
    if "TEXCOORD_0" in attributes:
        with_texture_coordinates(mesh, _upward(buffers.accessor(attributes["TEXCOORD_0"])))
    return mesh, buffers.accessor(attributes["COLOR_0"]) if "COLOR_0" in attributes else None


def _upward(uv: NDArray[Any]) -> NDArray[Any]:
    """glTF has v = 0 at the top of a picture, here it is at its bottom."""
    return np.asarray([0, 1] + [1, -1] * uv[:, :2].astype(np.float64))


def _draco_mesh(
    packed: dict[str, Any], buffers: Buffers
) -> tuple[trimesh.Trimesh, NDArray[Any] | None]:
    decoder = library("DracoPy", DRACO, "draco")
    result = decoder.decode(bytes(buffers.view(packed["bufferView"])))
    faces = getattr(result, "faces", None)
    if faces is None or len(faces) > MAX_TRIANGLES:
        raise InputError("a mesh that Draco has compressed holds no triangles, or over the limit")
    mesh = trimesh.Trimesh(result.points, faces, process=False)
    data = {row["unique_id"]: row["data"] for row in result.attributes}
    uv, colors = (data.get(packed["attributes"].get(name)) for name in ("TEXCOORD_0", "COLOR_0"))
    if uv is not None:
        with_texture_coordinates(mesh, _upward(uv))
    if colors is not None and colors.dtype.kind == "u":
        colors = colors / np.iinfo(colors.dtype).max
    return mesh, colors


def _faces(corners: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Triangles (t, 3) of a list of corners; a strip turns every other one, repeats are none."""
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if mode == FAN:
        first = np.full(max(0, len(corners) - 2), corners[0] if len(corners) else 0)
        faces = np.column_stack([first, corners[1:-1], corners[2:]])
    else:
        faces = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
        faces[1::2] = faces[1::2, [1, 0, 2]]
    repeats = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return faces[~repeats]
