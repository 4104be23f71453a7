"""OBJ, STL, PLY and OFF files, read with trimesh."""

import io
import re
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from reconstruction.base.errors import InputError, naming
from spisim.scene.mesh_files import COMMENT, MARKS, decoded, plain_obj
from spisim.scene.shapes import MAX_TRIANGLES, check_mesh, plain_mesh, texture_coordinates
from spisim_formats.library.content import (
    Content,
    Part,
    Surface,
    readable,
    with_texture_coordinates,
)
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.library.records import Rest
from spisim_formats.library.shapes import as_mesh
from spisim_formats.library.vertex_colors import mean_color, tinted
from spisim_formats.meshes.library import Described, read_library
from spisim_formats.meshes.rest import (
    MTL,
    OBJ,
    unread_off,
    unread_ply,
    unread_stl,
    unread_words,
)

#: NumPy's message when trimesh parses a truncated file or invalid numbers.
CUT_SHORT = "string or file could not be read to its end"

#: Maximum groups of an OBJ file that become objects; some programs have one per face.
MAX_GROUPS = 1000


def read_obj(path: Path, folders: Folders) -> Content:
    """Read the parts of an OBJ file, one per object and material."""
    content = Content()
    text = _text(path, content)
    if re.search(r"^[lp]\s", text, re.M):
        content.note(f"{path.name}: points and lines are left out")
        if not re.search(r"^f\s", text, re.M):
            return content
    materials = _material_library(text, path, folders, content)
    names = dict.fromkeys(name.strip() for name in re.findall(r"^usemtl (.+)$", text, re.M))
    # trimesh keeps the name of a material only if a library defines it.
    library = "".join(f"newmtl {name}\nKd 0 0 0\n" for name in names).encode()
    described = _grouped(re.sub(r"^mtllib.*$", "", text, flags=re.M))
    scene = _trimesh(
        f"mtllib materials\n{described}".encode(),
        path,
        resolver={"materials": library},
        split_objects=True,
    )
    for name, mesh in scene.geometry.items():
        surface = Surface(getattr(getattr(mesh.visual, "material", None), "name", None))
        if surface.name not in names:
            surface = Surface()
        else:
            name_there = surface.name or ""
            surface = materials.get(name_there, Described()).surface(name_there, content)
        _add(content, path, name, mesh, surface)
    return content


def read_stl(path: Path, folders: Folders) -> Content:
    """Read the solids of an STL file; it has no materials."""
    return _without_materials(read_bytes(path), path, unread_stl)


def read_ply(path: Path, folders: Folders) -> Content:
    """Read the mesh of a PLY file; it has no materials."""
    data = read_bytes(path)
    if not data.startswith(b"ply"):
        raise InputError(f"{path}: cannot be read as PLY: it does not begin with ply")
    header = data[: data.find(b"end_header")]
    faces = 0
    for kind, count in re.findall(rb"^element\s+(\S+)\s+(\S+)", header, re.M):
        if not count.isdigit() or int(count) > 3 * MAX_TRIANGLES:
            raise InputError(
                f"{path}: {count.decode(errors='replace')} of {kind.decode(errors='replace')}; "
                f"more than {3 * MAX_TRIANGLES:,} are not read"
            )
        faces = int(count) if kind == b"face" else faces
    content = _without_materials(data, path)
    content.records.append((path.name, unread_ply(header).copy))
    result = sum(len(as_mesh(part.geometry).faces) for part in content.parts)
    if result < faces and not content.left_out:
        raise InputError(f"{path}: cut off: {result:,} of {faces:,} faces are there")
    return content


def read_off(path: Path, folders: Folders) -> Content:
    """Read the mesh of an OFF file; it has no materials."""
    return _without_materials(read_bytes(path), path, unread_off)


def _without_materials(
    data: bytes, path: Path, unread: Callable[[bytes], Rest] | None = None
) -> Content:
    content = Content()
    kind = path.suffix.lower()
    with readable(str(path), kind[1:].upper()), naming(path):
        data, fault = plain_mesh(data, kind)
    _note_fault(content, path, fault)
    if unread is not None:
        content.records.append((path.name, unread(data).copy))
    scene = _trimesh(data, path, resolver={}, skip_materials=True)
    for mesh in scene.geometry.values():
        _add(content, path, path.stem, mesh, Surface())
    return content


def _add(content: Content, path: Path, name: str, mesh: object, surface: Surface) -> None:
    if not isinstance(mesh, trimesh.Trimesh):
        content.note(f"{path.name}: points and lines are left out")
        return
    with content.leaving_out(f"mesh {quoted(name)}"):
        plain = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        check_mesh(plain, name)
        if (uv := texture_coordinates(mesh)) is not None:
            plain = with_texture_coordinates(plain, uv)
        elif isinstance(mesh.visual, trimesh.visual.ColorVisuals) and mesh.visual.kind == "vertex":
            color = mean_color(mesh.visual.vertex_colors / 255, mesh.faces, mesh.area_faces)
            surface = tinted(surface, color, content, name)
        content.add(Part(name, plain, np.eye(4), surface))


def _trimesh(data: bytes, path: Path, **options: object) -> trimesh.Scene:
    kind = path.suffix.lower().lstrip(".")
    with readable(str(path), kind.upper()), warnings.catch_warnings():
        warnings.filterwarnings("error", message=CUT_SHORT)
        return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False, **options)


def _text(path: Path, content: Content) -> str:
    data = read_bytes(path)
    if b"\0" in data[:4096] and data[:2] not in MARKS:
        raise InputError(f"{path}: cannot be read as OBJ: it is not a text file")
    with readable(str(path), "OBJ"), naming(path):
        described = decoded(data)
        text, fault = plain_obj(described)
    content.records.append((path.name, unread_words(described, OBJ).copy))
    _note_fault(content, path, fault)
    return text


def _note_fault(content: Content, path: Path, fault: str) -> None:
    if fault:
        content.note(f"{path.name}: {fault}")


def _grouped(text: str) -> str:
    """Turn groups into objects, if the text has no objects of its own."""
    groups = len(re.findall(r"^g[ \t]+\S", text, re.M))
    if re.search(r"^o[ \t]", text, re.M) or groups > MAX_GROUPS:
        return text
    return re.sub(r"^g(?=[ \t]+\S)", "o", text, flags=re.M)


def _material_library(
    text: str, path: Path, folders: Folders, content: Content
) -> dict[str, Described]:
    """Return the materials of an OBJ file's libraries; note missing files."""
    materials: dict[str, Described] = {}
    for name in _libraries(text):
        try:
            library = folders.find(name, path.parent, f"{path.name}: mtllib")
            lines = decoded(read_bytes(library)).split("\n")
        except InputError as error:
            content.note(f"{error}; materials go by their names alone")
            continue
        materials |= read_library(lines, library, folders, content)
        unread = unread_words("\n".join(lines), MTL, "materials")
        content.records.append((library.name, unread.copy))
    return materials


def _libraries(text: str) -> list[str]:
    """Names of files in the lines `mtllib`, of which each may list several."""
    lines = re.findall(r"^mtllib +(.+)$", text, re.M)
    return [
        name
        for line in lines
        for name in re.findall(r"\S.*?\.mtl(?= |$)", line, re.I) or [COMMENT.sub("", line).strip()]
    ]
