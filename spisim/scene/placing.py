"""Objects of a description: their materials, and their meshes in world coordinates."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from hashlib import blake2b, file_digest
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import trimesh

from reconstruction.base.errors import InputError
from spisim.scene.content import mesh_content
from spisim.scene.description import MeshObject, ObjectDescription, Pose, SceneDescription
from spisim.scene.load_context import LoadContext
from spisim.scene.materials import Material, find_material, make_material
from spisim.scene.model import SceneObject, SceneWarning
from spisim.scene.pose import Vector3, pose_matrix
from spisim.scene.shapes import check_triangles, make_mesh, texture_coordinates

#: Files rarely hold wider meshes, except in other units than metres.
MAX_MESH_WIDTH_M = 300.0
#: Single precision does not resolve metres beyond this.
MAX_COORDINATE_M = 1e6

Meshes: TypeAlias = Mapping[str, trimesh.Trimesh]


def placed_objects(
    described: SceneDescription, context: LoadContext, meshes: Meshes
) -> tuple[SceneObject, ...]:
    """Objects of a description, cached; `meshes` are mesh files in memory, by name."""
    try:
        key = _key(described, context, meshes)
    except OSError:  # a missing file, which `_placed` reports
        return _placed(described, context, meshes)
    return context.cache.objects(key, lambda: _placed(described, context, meshes))


def _placed(
    described: SceneDescription, context: LoadContext, meshes: Meshes
) -> tuple[SceneObject, ...]:
    folder, wavelength_nm = context.folder, context.wavelength_nm
    materials: dict[str, Material] = {}
    for name, own in described.materials.items():
        with context.problems_at(f"materials.{name}"):
            materials[name] = make_material(name, own, folder, wavelength_nm)
    with context.problems_at("material_swaps"):
        for name in described.material_swaps.values():
            find_material(name, materials, wavelength_nm)
    objects: list[SceneObject] = []
    triangles = 0
    for i, row in enumerate(described.objects):
        with context.problems_at(f"objects[{i}] ({row.name})"):
            name = described.material_swaps.get(row.material, row.material)
            material = find_material(name, materials, wavelength_nm)
            copies = _place(row, material, folder, meshes)
            triangles += sum(len(thing.mesh.faces) for thing in copies)
            check_triangles(triangles)
            objects += copies
    return tuple(objects)


def radians(degrees: Vector3) -> Vector3:
    """Three angles in radians."""
    x, y, z = (math.radians(angle) for angle in degrees)
    return x, y, z


def _place(
    described: ObjectDescription, material: Material, folder: Path, meshes: Meshes
) -> list[SceneObject]:
    """An object, or its instances, with meshes in world coordinates."""
    read = isinstance(described, MeshObject) and described.mesh not in meshes
    if isinstance(described, MeshObject) and not read:
        mesh = meshes[described.mesh].copy()
    else:
        mesh = make_mesh(described, folder)
    if material.needs_texture_coordinates and texture_coordinates(mesh) is None:
        what = f"mesh {described.mesh!r}" if isinstance(described, MeshObject) else "this shape"
        raise InputError(
            f"{what} has no texture coordinates, which material {material.name!r} needs for its "
            "texture or opacity"
        )
    mesh.apply_scale(described.scale)
    if read and (width_m := float(mesh.extents.max())) >= MAX_MESH_WIDTH_M:
        warnings.warn(
            f"{described.name!r} is {width_m:.3g} m wide; all lengths are metres, and "
            "`scale: 0.001` makes metres of a mesh in millimetres",
            SceneWarning,
            stacklevel=2,
        )
    mesh.apply_transform(pose_matrix(described.rotate_deg, described.translate_m))
    check_triangles(len(mesh.faces) * len(described.instances or [mesh]))
    instances = {described.name: mesh}
    if described.instances is not None:
        instances = {
            f"{described.name}-{i}": _posed(mesh, instance)
            for i, instance in enumerate(described.instances, start=1)
        }
    for posed in instances.values():
        if not (far := float(np.abs(posed.bounds).max())) <= MAX_COORDINATE_M:
            raise InputError(f"reaches {far:.3g} m from the origin; at most {MAX_COORDINATE_M:g} m")
    turning = radians(described.angular_velocity_deg_s)
    return [
        SceneObject(name, posed, material, described.velocity_m_s, turning, mesh)
        for name, posed in instances.items()
    ]


def _posed(mesh: trimesh.Trimesh, pose: Pose) -> trimesh.Trimesh:
    """A moved copy; trimesh's own copying would take most of the time."""
    matrix = pose_matrix(pose.rotate_deg, pose.translate_m)
    points = np.asarray(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
    uv = texture_coordinates(mesh)
    visual = None if uv is None else trimesh.visual.TextureVisuals(uv=uv)
    return trimesh.Trimesh(points, np.array(mesh.faces), process=False, visual=visual)


def _key(described: SceneDescription, context: LoadContext, meshes: Meshes) -> bytes:
    """Digest of everything that the objects are made from."""
    given = [sorted(own.model_fields_set) for own in described.materials.values()]
    sections = described.objects, described.materials, described.material_swaps
    result = blake2b(repr((*sections, given, context.wavelength_nm)).encode())
    for name, mesh in meshes.items():
        result.update(name.encode() + mesh_content(mesh))
    for path in _files(described, context.folder, meshes):
        if not path.is_file():  # pipes and devices may never end
            raise FileNotFoundError(path)
        with path.open("rb") as file:
            result.update(file_digest(file, "blake2b").digest())
    return result.digest()


def _files(described: SceneDescription, folder: Path, meshes: Meshes) -> Iterator[Path]:
    names: list[Any] = [row.mesh for row in described.objects if isinstance(row, MeshObject)]
    yield from (folder / name for name in dict.fromkeys(names) if name not in meshes)
    for own in described.materials.values():
        yield from (folder / name for name in (own.texture, own.opacity) if isinstance(name, str))
