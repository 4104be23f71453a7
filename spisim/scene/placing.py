"""Objects of a description: materials found, meshes made and put in their places."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import trimesh

from reconstruction.base.errors import InputError
from spisim.scene.description import MeshObject, ObjectDescription, Pose, SceneDescription
from spisim.scene.materials import Material, find_material, make_material
from spisim.scene.model import SceneObject, Vector3
from spisim.scene.pose import pose_matrix
from spisim.scene.shapes import check_triangles, make_mesh, texture_coordinates
from spisim.scene.warning import SceneWarning

if TYPE_CHECKING:
    from spisim.scene.load_context import LoadContext

#: What a file has is hardly wider; of a horizon that is drawn, its sizes tell the unit.
WIDEST_MESH_M = 300.0
#: Beyond this not even metres are told apart in single precision.
MAX_COORDINATE_M = 1e6

Meshes: TypeAlias = Mapping[str, trimesh.Trimesh]


def placed(
    described: SceneDescription, context: LoadContext, meshes: Meshes
) -> tuple[SceneObject, ...]:
    """All objects of a description; `meshes` are mesh files that are in memory, by name.

    Raises InputError, naming source and field.
    """
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
    """Three angles."""
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
    if read and (width_m := float(mesh.extents.max())) >= WIDEST_MESH_M:
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
    """A copy elsewhere; what trimesh's own copying looks after would take most of the time."""
    matrix = pose_matrix(pose.rotate_deg, pose.translate_m)
    points = np.asarray(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
    uv = texture_coordinates(mesh)
    visual = None if uv is None else trimesh.visual.TextureVisuals(uv=uv)
    return trimesh.Trimesh(points, np.array(mesh.faces), process=False, visual=visual)
