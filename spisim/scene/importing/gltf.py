"""glTF 2.0 (.glb, .gltf): nodes and materials from the JSON, triangles through trimesh.

trimesh's own scene graph is not used: it drops what hangs below a camera, and loops where a damaged
file has nodes in a circle. What trimesh would read as zeros is refused here.
"""

import io
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from trimesh.exchange.gltf import load_glb, load_gltf

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.scene.importing.files import MAX_FILE_BYTES, Folders, read_bytes, shown
from spisim.scene.importing.model import (
    Content,
    Part,
    Surface,
    readable,
    scaling,
    translation,
)
from spisim.scene.shapes import MAX_TRIANGLES, check_mesh

MAGIC = b"glTF"
JSON_CHUNK = 0x4E4F534A
TRIANGLES, STRIP = 4, 5
#: Modes of primitives that trimesh returns, in the file's order; it drops the others.
RETURNED_MODES = (0, 1, TRIANGLES, STRIP)
COMPONENT_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
#: What a header lists, each of it an object.
LISTS = ("scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers", "materials", "images")
#: Extensions that change how surfaces look, not where they are.
HARMLESS = (
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_lights_",
    "KHR_mesh_quantization",
)


def read_glb(path: Path, folders: Folders) -> Content:
    """Parts of a binary glTF file, metres, y up. InputError if damaged or not supported."""
    data = read_bytes(path)
    with readable(str(path), "a GLB file"):
        header = _glb_header(data)
        buffers = _check(header, path, folders)
        roots = _roots(header)
        loaded = load_glb(io.BytesIO(data), resolver=buffers, skip_materials=True)
        return _content(header, roots, loaded["geometry"], path, folders)


def read_gltf(path: Path, folders: Folders) -> Content:
    """Parts of a glTF file and its buffers, as `read_glb`."""
    data = read_bytes(path)
    with readable(str(path), "a glTF file"):
        header = json.loads(data)
        buffers = _check(header, path, folders)
        roots = _roots(header)
        loaded = load_gltf(io.BytesIO(data), resolver=buffers, skip_materials=True)
        return _content(header, roots, loaded["geometry"], path, folders)


def _glb_header(data: bytes) -> Any:
    if len(data) < 20 or data[:4] != MAGIC:
        raise InputError("cannot be read as a GLB file: it does not begin with glTF")
    version, length, chunk_length, chunk_type = struct.unpack_from("<4I", data, 4)
    if version != 2:
        raise InputError(f"glTF version {version}; only version 2 is read")
    if length > len(data) or 20 + chunk_length > len(data):
        raise InputError(f"the file ends early: {len(data)} of {max(length, chunk_length)} bytes")
    if chunk_type != JSON_CHUNK:
        raise InputError("its first chunk is not JSON")
    return json.loads(data[20 : 20 + chunk_length])


def _check(header: Any, path: Path, folders: Folders) -> dict[str, bytes]:
    """External buffers by their URI; InputError for a header that cannot be trusted."""
    if not isinstance(header, dict) or "asset" not in header:
        raise InputError("its JSON is no glTF: `asset` is missing")
    for name in LISTS:
        rows = header.get(name, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise InputError(f"{name} should be a list of objects")
    for name in header.get("extensionsRequired", []):
        if not str(name).startswith(HARMLESS):
            raise InputError(f"needs the extension {name}, which is not supported; export without")
    buffers = _external_buffers(header, path, folders)
    for row in header.get("bufferViews", []):
        _whole(row, "byteOffset", 0)
        _whole(row, "byteLength")
    total = sum(_accessor_bytes(row, i) for i, row in enumerate(header.get("accessors", [])))
    if total > MAX_FILE_BYTES:
        raise InputError(
            f"its accessors hold {total / 1024**3:.3g} GB; more than 2 GB are not read"
        )
    count = sum(
        _triangles(primitive, header)
        for mesh in header.get("meshes", [])
        for primitive in mesh["primitives"]
    )
    if count > MAX_TRIANGLES:
        raise InputError(f"{count:,} triangles; more than {MAX_TRIANGLES:,} are not read")
    return buffers


def _external_buffers(header: dict[str, Any], path: Path, folders: Folders) -> dict[str, bytes]:
    buffers: dict[str, bytes] = {}
    for buffer in header.get("buffers", []):
        uri = buffer.get("uri")
        if uri is None or uri.startswith("data:") or uri in buffers:
            continue
        buffers[uri] = read_bytes(folders.find(_unquoted(uri), path.parent, "buffer"))
        if sum(map(len, buffers.values())) > MAX_FILE_BYTES:
            raise InputError("its buffers hold more than 2 GB together, which are not read")
    return buffers


def _unquoted(uri: str) -> str:
    return uri if "://" in uri else unquote(uri)


def _accessor_bytes(row: dict[str, Any], index: int) -> int:
    if "sparse" in row:
        raise InputError(f"accessor {index} is sparse, which is not supported; export without")
    if "bufferView" not in row:
        raise InputError(f"accessor {index} has no bufferView: its data are not in the file")
    _whole(row, "byteOffset", 0)
    count = _whole(row, "count")
    return count * COMPONENT_BYTES[row["componentType"]] * COMPONENTS[row["type"]]


def _triangles(primitive: dict[str, Any], header: dict[str, Any]) -> int:
    accessors = header.get("accessors", [])
    position = _at(accessors, primitive["attributes"]["POSITION"], "accessor")
    if position.get("normalized"):
        raise InputError("has normalized integer positions, which are not supported")
    index = primitive.get("indices")
    corners = position if index is None else _at(accessors, index, "accessor")
    mode = primitive.get("mode", TRIANGLES)
    return int(corners["count"]) // (3 if mode == TRIANGLES else 1)


def _content(
    header: dict[str, Any],
    roots: list[int],
    geometry: dict[str, Any],
    path: Path,
    folders: Folders,
) -> Content:
    content = Content(
        unit_why="glTF is in metres", up="y", up_why="glTF has y up", notes=_notes(header)
    )
    _note_textures(header, path, folders, content)
    surfaces = [_surface(row, header) for row in header.get("materials", [])]
    meshes = _meshes(header, geometry, surfaces, content)
    nodes = header.get("nodes", [])
    waiting = [(_at(nodes, i, "node"), i, np.eye(4)) for i in reversed(roots)]
    seen: set[int] = set()
    while waiting:
        node, number, parent = waiting.pop()
        if number in seen:
            raise InputError(f"node {number} is reached twice: the nodes are no tree")
        seen.add(number)
        to_world = parent @ _matrix(node, number)
        if "mesh" in node:
            for mesh, surface, name in _at(meshes, node["mesh"], "mesh"):
                content.add(Part(node.get("name") or name, mesh, to_world, surface))
        children = reversed(node.get("children", []))
        waiting += [(_at(nodes, child, "node"), child, to_world) for child in children]
    return content


def _roots(header: dict[str, Any]) -> list[int]:
    if "scenes" in header:
        return list(_at(header["scenes"], header.get("scene", 0), "scene").get("nodes", []))
    nodes = header.get("nodes", [])
    below = {child for node in nodes for child in node.get("children", [])}
    return [i for i in range(len(nodes)) if i not in below]


def _meshes(
    header: dict[str, Any], geometry: dict[str, Any], surfaces: list[Surface], content: Content
) -> list[list[tuple[trimesh.Trimesh, Surface, str]]]:
    """Per mesh of the file its primitives of triangles: mesh, surface and name."""
    arrays = iter(geometry.values())
    meshes = []
    for number, row in enumerate(header.get("meshes", [])):
        name = row.get("name") or f"mesh {number}"
        primitives = []
        for primitive in row["primitives"]:
            mode = primitive.get("mode", TRIANGLES)
            found = next(arrays) if mode in RETURNED_MODES else None
            if found is None or mode not in (TRIANGLES, STRIP):
                content.note(f"mesh {shown(name)}: points, lines and fans are left out")
                continue
            mesh = trimesh.Trimesh(found["vertices"], found["faces"], process=False)
            check_mesh(mesh, name)
            surface = Surface()
            if "material" in primitive:
                surface = _at(surfaces, primitive["material"], "material")
            primitives.append((mesh, surface, name))
        meshes.append(primitives)
    if next(arrays, None) is not None:
        raise InputError("its primitives cannot be told apart")
    return meshes


def _surface(row: dict[str, Any], header: dict[str, Any]) -> Surface:
    pbr = row.get("pbrMetallicRoughness", {})
    color = pbr.get("baseColorFactor")
    words: tuple[str, ...] = ()
    if "KHR_materials_transmission" in row.get("extensions", {}):
        words = ("dielectric",)
    elif pbr.get("metallicFactor", 1 if color else 0) >= 0.5 and "baseColorTexture" not in pbr:
        words = ("metal",)
    if color is None or "baseColorTexture" in pbr:
        return Surface(row.get("name"), None, words)
    red, green, blue = (float(value) for value in color[:3])
    return Surface(row.get("name"), (red, green, blue), words)


def _notes(header: dict[str, Any]) -> list[str]:
    notes = []
    if header.get("animations"):
        notes.append("animations are left out: everything stands as the nodes say")
    if header.get("skins"):
        notes.append("skins are left out: skinned meshes are in their bind pose")
    return notes


def _note_textures(header: dict[str, Any], path: Path, folders: Folders, content: Content) -> None:
    for image in header.get("images", []):
        uri = image.get("uri")
        if uri is None or uri.startswith("data:"):
            continue
        content.note_texture(_unquoted(uri), path.parent, folders, "texture")


def _matrix(node: dict[str, Any], number: int) -> Floats:
    """Pose of a node in its parent: a matrix by columns, or translation, rotation, scale."""
    pose = np.eye(4)
    if "matrix" in node:
        pose = np.reshape(np.asarray(node["matrix"], float), (4, 4)).T
    if "translation" in node:
        pose = pose @ translation(node["translation"])
    if "rotation" in node:
        quaternion = np.asarray(node["rotation"], float)
        if not np.linalg.norm(quaternion) > 0:
            raise InputError(f"node {number}: its rotation is zero")
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
        pose = pose @ turn
    if "scale" in node:
        pose = pose @ scaling(node["scale"])
    return np.asarray(pose)


def _at(rows: list[Any], index: Any, what: str) -> Any:
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(rows):
        raise InputError(f"refers to {what} {_shown(index)}; there are {len(rows)}")
    return rows[index]


def _whole(row: dict[str, Any], name: str, default: int | None = None) -> int:
    value = row.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise InputError(f"{name} should be a whole number of at least 0; found {_shown(value)}")
    return value


def _shown(value: Any) -> str:
    """A value as it stands in the file."""
    return json.dumps(value)[:80]
