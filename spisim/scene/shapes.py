"""Meshes of objects, from files and simple shapes."""

import io
import warnings
from pathlib import Path

import numpy as np
import trimesh
from trimesh.exchange.ply import load_ply

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError
from spisim.base.config.files import check_is_there
from spisim.scene.description import (
    BoxObject,
    CylinderObject,
    MeshObject,
    ObjectDescription,
    RectangleObject,
    SphereObject,
)
from spisim.scene.mesh_files import decoded, plain_obj, plain_off, plain_stl
from spisim.scene.model import SceneWarning
from spisim.scene.ply_files import plain_ply

SPHERE_SUBDIVISIONS = 4  # 5120 triangles, radius true to 0.1 %
CYLINDER_SECTIONS = 96  # radius true to 0.05 %

#: Maximum triangles: every instance is a mesh in memory.
MAX_TRIANGLES = 20_000_000
#: Maximum coordinate in the file's unit, beyond which areas and volumes overflow.
MAX_COORDINATE = 1e30

#: Formats of plain triangles.
FORMATS = (".ply", ".obj", ".stl", ".off")
#: Formats with a unit, axes or nodes of their own.
SCENE_FORMATS = (".dae", ".glb", ".gltf")


def make_mesh(described: ObjectDescription, folder: Path) -> trimesh.Trimesh:
    """Mesh of an object in its own coordinates, metres; InputError for an unusable file."""
    match described:
        case MeshObject():
            return load_mesh(folder / described.mesh)
        case BoxObject():
            return trimesh.creation.box(described.size_m)
        case RectangleObject():
            return _rectangle(*described.size_m)
        case SphereObject():
            return trimesh.creation.icosphere(SPHERE_SUBDIVISIONS, described.radius_m)
        case CylinderObject():
            return trimesh.creation.cylinder(
                described.radius_m, described.height_m, sections=CYLINDER_SECTIONS
            )
    raise TypeError(f"no mesh for {type(described).__name__}")


def load_mesh(path: Path) -> trimesh.Trimesh:
    """Triangles of a mesh file as stored; InputError if it is missing, unknown or unusable."""
    check_is_there(path, "mesh")
    suffix = path.suffix.lower()
    if suffix in SCENE_FORMATS:
        raise InputError(
            f"mesh {path.name!r} has a unit, axes or nodes of its own, which a mesh should not; "
            f"`spisim scenes import {path} -o {path.stem}.yaml` makes a scene file and PLY files "
            "of it"
        )
    if suffix not in FORMATS:
        raise InputError(f"mesh {path.name!r} has an unknown format; allowed: {' '.join(FORMATS)}")
    try:
        data, fault = plain_mesh(path.read_bytes(), suffix)
        mesh = _read_ply(data) if suffix == ".ply" else _read(data, suffix[1:])
    except InputError as error:
        raise InputError(f"mesh {path.name!r}: {error}") from None
    # trimesh's parsers raise many kinds of exceptions.
    except Exception:
        raise InputError(f"mesh {path.name!r} cannot be read: damaged, or not {suffix}") from None
    check_mesh(mesh, path.name)
    if fault:
        warnings.warn(f"mesh {path.name!r}: {fault}", SceneWarning, stacklevel=2)
    return mesh


def plain_mesh(data: bytes, suffix: str) -> tuple[bytes, str]:
    """Mesh file as trimesh reads it well, and what is wrong with its polygons or left out."""
    if suffix == ".stl":
        return plain_stl(data)
    if suffix == ".ply":
        return plain_ply(data)
    text, fault = plain_obj(decoded(data)) if suffix == ".obj" else plain_off(decoded(data))
    return text.encode(), fault


def _read(data: bytes, kind: str) -> trimesh.Trimesh:
    mesh = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False, skip_materials=True)
    return mesh.to_mesh() if isinstance(mesh, trimesh.Scene) else mesh


def _read_ply(data: bytes) -> trimesh.Trimesh:
    """Read without trimesh's scene, which copies a mesh three times."""
    parts = load_ply(io.BytesIO(data), skip_materials=True)
    parts.pop("metadata", None)  # a second copy of the file
    return trimesh.Trimesh(**parts, process=False)


def texture_coordinates(mesh: trimesh.Trimesh) -> Floats | None:
    """Texture coordinates (vertices, 2), u to the right and v up; None without usable ones."""
    uv = getattr(mesh.visual, "uv", None)
    if uv is None or len(uv) != len(mesh.vertices) or not np.isfinite(uv).all():
        return None
    return np.asarray(uv, dtype=np.float64)[:, :2]


def check_mesh(mesh: trimesh.Trimesh, name: str) -> None:
    """InputError unless a mesh has triangles of non-zero area and finite vertices."""
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputError(f"mesh {name!r} is empty: it has no triangles")
    if mesh.faces.shape[1:] != (3,) or mesh.vertices.shape[1:] != (3,):
        raise InputError(f"mesh {name!r} is damaged: its faces are not triangles in 3-D")
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        raise InputError(f"mesh {name!r} is damaged: a triangle refers to a vertex not in the file")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"mesh {name!r} has vertices that are not finite (NaN or infinite)")
    if (far := float(np.abs(mesh.vertices).max())) > MAX_COORDINATE:
        raise InputError(
            f"mesh {name!r} reaches {far:.3g} from its origin, in its own unit; at most "
            f"{MAX_COORDINATE:g}"
        )
    if not mesh.area > 0:
        raise InputError(f"mesh {name!r} has no area: all its triangles are degenerate")


def check_triangles(count: int) -> None:
    """InputError for too many triangles."""
    if count > MAX_TRIANGLES:
        raise LimitError(
            f"{count:,} triangles, instances counted; more than {MAX_TRIANGLES:,} are not read"
        )


def _rectangle(width_m: float, height_m: float) -> trimesh.Trimesh:
    x, y = width_m / 2, height_m / 2
    vertices = [[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]]
    corners = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]])
    return trimesh.Trimesh(vertices, [[0, 1, 2], [0, 2, 3]], process=False, visual=corners)
