"""glTF 2.0 (.glb, .gltf): nodes, meshes, what materials say.

trimesh's reader is not used: it drops what hangs below a camera, loops where a damaged file has
nodes in a circle, reads zeros for what is not in the file, and knows neither sparse nor compressed
meshes.
"""

import json
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError
from spisim_formats.gltf.buffers import MESHOPT, Buffers, at, check_sizes
from spisim_formats.gltf.lamps import node_lamps
from spisim_formats.gltf.materials import read_surfaces
from spisim_formats.gltf.meshes import DRACO, Primitive, check_triangle_count, read_mesh
from spisim_formats.library.content import (
    MAX_PARTS,
    Content,
    Part,
    Surface,
    readable,
    scaling,
    translation,
)
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.library.records import RecordedObject, unread_keys, words
from spisim_formats.library.vertex_colors import mean_color, tinted

MAGIC = b"glTF"
JSON_CHUNK, BINARY_CHUNK = 0x4E4F534A, 0x004E4942
#: Lists of objects in a header.
LISTS = ("scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers", "materials", "images",
         "textures", "cameras")  # fmt: skip
#: glTF's cameras look along their -z, x to the right.
LOOKING = np.diag([-1.0, 1.0, -1.0, 1.0])
INSTANCING = "EXT_mesh_gpu_instancing"
VISIBILITY = "KHR_node_visibility"
#: Keys that light does not see, that other notes name (skins and animations), and that are of what
#: is counted as read or not elsewhere (numbers of attributes).
HARMLESS = words("""
accessors animations asset bufferViews buffers cameras doubleSided extensionsRequired
extensionsUsed name occlusionTexture sampler samplers skin skins JOINTS_0 NORMAL POSITION
TANGENT WEIGHTS_0
""")
#: Extensions that are read, and those that change how surfaces look, not where they are.
AVAILABLE = (
    DRACO,
    *MESHOPT,
    INSTANCING,
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_mesh_quantization",
    "KHR_technique_webgl",
    "KHR_techniques_webgl",
    "KHR_animation_",
    VISIBILITY,
    "KHR_xmp",
)


def read_glb(path: Path, folders: Folders) -> Content:
    """Read the parts of a binary glTF file, in metres, y up. Raises InputError if it is invalid."""
    data = read_bytes(path)
    with readable(str(path), "a GLB file"):
        header, chunk = _glb_chunks(data)
        return _content(header, chunk, path, folders)


def read_gltf(path: Path, folders: Folders) -> Content:
    """Read the parts of a glTF file and its buffers, as `read_glb`."""
    data = read_bytes(path)
    with readable(str(path), "a glTF file"):
        return _content(_json(data), b"", path, folders)


def _json(data: bytes) -> Any:
    return json.loads(data, object_hook=RecordedObject)


def _glb_chunks(data: bytes) -> tuple[Any, bytes]:
    """Return the JSON of a GLB file, and its binary chunk."""
    if len(data) < 20 or data[:4] != MAGIC:
        raise InputError("cannot be read as a GLB file: it does not begin with glTF")
    version, length, chunk_length, chunk_type = struct.unpack_from("<4I", data, 4)
    if version != 2:
        raise InputError(f"glTF version {version}; {ONLY_2}")
    if length > len(data) or 20 + chunk_length > len(data):
        raise InputError(f"the file ends early: {len(data)} of {max(length, chunk_length)} bytes")
    if chunk_type != JSON_CHUNK:
        raise InputError("its first chunk is not JSON")
    header = _json(data[20 : 20 + chunk_length])
    start = 20 + chunk_length
    if start + 8 > len(data):
        return header, b""
    size, kind = struct.unpack_from("<2I", data, start)
    return header, data[start + 8 : start + 8 + size] if kind == BINARY_CHUNK else b""


ONLY_2 = "only version 2 is read: Blender and gltf-pipeline make one of it"


def _check(header: Any) -> None:
    """Raise InputError for an invalid header."""
    if not isinstance(header, dict) or not isinstance(header.get("asset"), dict):
        raise InputError("its JSON is no glTF: `asset` is missing")
    if str(header["asset"].get("version", "2")).startswith("1"):
        raise InputError(f"glTF version 1; {ONLY_2}")
    for name in LISTS:
        rows = header.get(name, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise InputError(f"{name} should be a list of objects")
    for name in header.get("extensionsRequired", []):
        if not str(name).startswith(AVAILABLE):
            raise InputError(f"needs the extension {name}, which is not supported; export without")
    check_sizes(header)
    check_triangle_count(header)


def _content(header: Any, chunk: bytes, path: Path, folders: Folders) -> Content:
    _check(header)
    roots = _roots(header)
    buffers = Buffers(header, path, folders, chunk)
    content = Content(
        unit_why="glTF is in metres", up="y", up_why="glTF has y up", notes=_notes(header)
    )
    content.records.append((path.name, partial(unread_keys, header, HARMLESS)))
    surfaces = read_surfaces(header, buffers, path, folders, content)
    meshes = _Meshes(header, buffers, content)
    nodes = header.get("nodes", [])
    waiting: list[tuple[Any, Floats]] = [(number, np.eye(4)) for number in reversed(roots)]
    seen: set[int] = set()
    while waiting:
        number, parent = waiting.pop()
        with content.leaving_out(f"node {number!r:.80}"):
            node = at(nodes, number, "node")
            if number in seen:
                raise InputError(f"node {number} is reached twice: the nodes are no tree")
            seen.add(number)
            if _is_hidden(node):
                content.note("nodes that the file hides are left out, with all below")
                continue
            to_world = parent @ _matrix(node, number)
            waiting += [(child, to_world) for child in reversed(node.get("children", []))]
            if "camera" in node:
                content.cameras.append(to_world @ LOOKING)
            content.glows += node_lamps(node, header, to_world, content)
            if "mesh" in node:
                displayed_there = meshes.of(node)
                for copy in _copies(node, buffers):
                    _add(content, node, displayed_there, to_world @ copy, surfaces)
    return content


class _Meshes:
    """Meshes by number and weights of their morphs."""

    def __init__(self, header: dict[str, Any], buffers: Buffers, content: Content) -> None:
        self._rows = header.get("meshes", [])
        self._buffers, self._content = buffers, content
        self._made: dict[tuple[int, str], list[Primitive]] = {}

    def of(self, node: dict[str, Any]) -> list[Primitive]:
        """Return the primitives of a node's mesh, by its own weights, else the mesh's."""
        row = at(self._rows, node["mesh"], "mesh")
        weights = node.get("weights", row.get("weights"))
        key = node["mesh"], repr(weights)
        if key not in self._made:
            made = read_mesh(row, node["mesh"], weights, self._buffers, self._content)
            self._made[key] = made
        return self._made[key]


def _is_hidden(node: dict[str, Any]) -> bool:
    return node.get("extensions", {}).get(VISIBILITY, {}).get("visible", True) is False


def _add(
    content: Content,
    node: dict[str, Any],
    primitives: list[Primitive],
    to_world: Floats,
    surfaces: list[Surface],
) -> None:
    for each in primitives:
        surface = Surface()
        with content.leaving_out(f"the material of mesh {quoted(each.name)}"):
            if each.material is not None:
                surface = at(surfaces, each.material, "material")
            if each.colors is not None:
                color = mean_color(each.colors, each.mesh.faces, each.mesh.area_faces)
                surface = tinted(surface, color, content, each.name)
        content.add(Part(node.get("name") or each.name, each.mesh, to_world, surface))


def _copies(node: dict[str, Any], buffers: Buffers) -> Iterator[Floats]:
    """Return poses of a node's mesh in its own coordinates: one, or those of its instances."""
    if INSTANCING not in node.get("extensions", {}):
        yield np.eye(4)
        return
    columns = {
        name.lower(): buffers.accessor(index)
        for name, index in node["extensions"][INSTANCING]["attributes"].items()
        if name in ("TRANSLATION", "ROTATION", "SCALE")
    }
    for row in range(min((len(column) for column in columns.values()), default=0)):
        if row >= MAX_PARTS:
            raise LimitError(f"more than {MAX_PARTS:,} parts (instances counted)")
        yield _matrix({name: column[row] for name, column in columns.items()}, row)


def _roots(header: dict[str, Any]) -> list[int]:
    if "scenes" in header:
        return list(at(header["scenes"], header.get("scene", 0), "scene").get("nodes", []))
    nodes = header.get("nodes", [])
    below = {child for node in nodes for child in node.get("children", [])}
    return [i for i in range(len(nodes)) if i not in below]


def _notes(header: dict[str, Any]) -> list[str]:
    notes = []
    if header.get("animations"):
        notes.append("animations are left out: everything stands as the nodes say")
    if header.get("skins"):
        notes.append("skins are left out: skinned meshes are in their bind pose")
    return notes


def _matrix(node: dict[str, Any], number: int) -> Floats:
    """Return the pose of a node in its parent, from a matrix by columns or from its components."""
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
