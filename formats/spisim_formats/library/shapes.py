"""Simple shapes as in a scene file, or as meshes if the scene file has no such shape."""

from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from pydantic import ValidationError

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene.description import BoxObject, CylinderObject, RectangleObject, SphereObject
from spisim.scene.shapes import CYLINDER_SECTIONS, SPHERE_SUBDIVISIONS, make_mesh
from spisim_formats.library.content import Shape

#: Tolerance of right angles in single precision.
RIGHT = 3e-7


def box(size: list[float], what: str) -> Shape:
    """Box with these edges, centred; InputError naming `what` for lengths that are not positive."""
    return _make(BoxObject, what, shape="box", size_m=size)


def rectangle(size: list[float], what: str) -> Shape:
    """Rectangle in x and y, centred; InputError as `box`."""
    return _make(RectangleObject, what, shape="rectangle", size_m=size)


def sphere(radius: float, what: str) -> Shape:
    """Sphere, centred; InputError as `box`."""
    return _make(SphereObject, what, shape="sphere", radius_m=radius)


def cylinder(radius: float, height: float, what: str) -> Shape:
    """Closed cylinder about z, centred; InputError as `box`."""
    return _make(CylinderObject, what, shape="cylinder", radius_m=radius, height_m=height)


def capsule(radius: float, length: float, what: str) -> trimesh.Trimesh:
    """Cylinder about z with half-spheres on both ends, centred; InputError as `box`."""
    cylinder(radius, length, what)
    count = [CYLINDER_SECTIONS, CYLINDER_SECTIONS]
    mesh = trimesh.creation.capsule(height=length, radius=radius, count=count)
    return mesh.apply_translation(-mesh.bounds.mean(axis=0))


def cone(radius: float, length: float, what: str) -> trimesh.Trimesh:
    """Closed cone about z, tip up, the middle of its height at 0; InputError as `box`."""
    cylinder(radius, length, what)
    mesh = trimesh.creation.cone(radius=radius, height=length, sections=CYLINDER_SECTIONS)
    return mesh.apply_translation([0, 0, -length / 2])


def ellipsoid(radii: list[float], what: str) -> trimesh.Trimesh:
    """Ellipsoid, centred; InputError as `box`."""
    box(radii, what)
    return trimesh.creation.icosphere(SPHERE_SUBDIVISIONS).apply_scale(radii)


def disk() -> trimesh.Trimesh:
    """Disk of radius 1 in x and y, facing z."""
    angles = np.linspace(0, 2 * np.pi, CYLINDER_SECTIONS, endpoint=False)
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    first = np.arange(CYLINDER_SECTIONS)
    faces = np.column_stack(
        [np.full_like(first, CYLINDER_SECTIONS), first, (first + 1) % CYLINDER_SECTIONS]
    )
    return trimesh.Trimesh([*rim, [0, 0, 0]], faces, process=False)


def tube(start: Floats, stop: Floats, radius: float, what: str) -> trimesh.Trimesh:
    """Cylinder between two points (3,), open at both ends; InputError as `box`."""
    axis = stop - start
    height = float(np.linalg.norm(axis))
    cylinder(radius, height, what)
    angles = np.linspace(0, 2 * np.pi, CYLINDER_SECTIONS, endpoint=False)
    rim = radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    low = np.arange(CYLINDER_SECTIONS)
    next_low = (low + 1) % CYLINDER_SECTIONS
    high, next_high = low + CYLINDER_SECTIONS, next_low + CYLINDER_SECTIONS
    faces = np.concatenate(
        [np.column_stack([low, next_low, next_high]), np.column_stack([low, next_high, high])]
    )
    mesh = trimesh.Trimesh(
        np.concatenate([rim, rim + np.array([0, 0, height])]), faces, process=False
    )
    turn = trimesh.geometry.align_vectors([0, 0, 1], axis / height)
    turn[:3, 3] = start
    return mesh.apply_transform(turn)


def as_mesh(geometry: trimesh.Trimesh | Shape) -> trimesh.Trimesh:
    """Return triangles of a part in its own coordinates; a mesh is returned as it is."""
    return geometry if isinstance(geometry, trimesh.Trimesh) else make_mesh(geometry, Path())


@np.errstate(all="ignore")  # lengths whose squares underflow are not at right angles
def stretched(geometry: Shape, to_world: Floats) -> tuple[Shape, Floats] | None:
    """Absorb a pose that scales a box or rectangle along its edges into the size.

    Returns it with a rigid pose, or None if the pose does more.
    """
    if not isinstance(geometry, BoxObject | RectangleObject):
        return None
    linear = to_world[:3, :3]
    lengths = np.linalg.norm(linear, axis=0)
    rotation = linear / lengths
    if not np.allclose(rotation.T @ rotation, np.eye(3), atol=RIGHT):
        return None
    if (
        np.linalg.det(rotation) < 0
    ):  # a box is symmetric in z; a rectangle's picture lies in x and y
        rotation[:, 2] *= -1
    size = tuple(float(s * x) for s, x in zip(geometry.size_m, lengths, strict=False))
    rigid = to_world.copy()
    rigid[:3, :3] = rotation
    return geometry.model_copy(update={"size_m": size}), rigid


def _make(kind: type[Shape], what: str, **fields: Any) -> Shape:
    """Create a shape of a scene file; name and material are set when it is written."""
    try:
        return kind(name="shape", material="none", **fields)
    except ValidationError as error:
        first = error.errors()[0]
        where = str(first["loc"][0]).removesuffix("_m")
        raise InputError(
            f"{what}: {where} should be a positive number; found {first['input']}"
        ) from None
