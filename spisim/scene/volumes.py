"""Volumes of fog and smoke: boxes, balls, and interiors of closed meshes."""

import warnings
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config.files import read_density
from spisim.scene.description import (
    BallVolume,
    BoxVolume,
    MeshVolume,
    ObjectVolume,
    VolumeDescription,
)
from spisim.scene.model import SceneObject, SceneWarning, Volume, find_object
from spisim.scene.pose import pose_matrix
from spisim.scene.rays import winding_number
from spisim.scene.shapes import load_mesh
from spisim.scene.soundness import INVERTED, fault, is_closed

#: Relative overlap of boxes that merely touch.
TOUCHING = 1e-9
#: Points that test volumes other than boxes for overlap, and the maximum triangles for it.
POINTS = 256
MAX_TRIANGLES = 20_000


def make_volume(
    described: VolumeDescription, objects: Sequence[SceneObject], folder: Path, wavelength_nm: float
) -> Volume:
    """The volume of a description, with meshes and densities from `folder`."""
    medium = described.made(folder, wavelength_nm)
    if medium.extinction_per_m == 0:
        raise InputError("extinction_per_m should be greater than 0 in a volume")
    shape: Literal["box", "ball"] | trimesh.Trimesh = "box"
    carrier = None
    match described:
        case BoxVolume():
            pose, low, high = _pose(described), *_centred(described.size_m)
        case BallVolume():
            shape = "ball"
            pose, low, high = _pose(described), *_centred([2 * described.radius_m] * 3)
        case MeshVolume():
            shape = closed(load_mesh(folder / described.mesh), described.mesh)
            shape.apply_scale(described.scale)
            pose, (low, high) = _pose(described), shape.bounds
            shape.apply_transform(pose)
        case ObjectVolume():
            carrier = find_object(described.object, objects)
            shape = closed(carrier.mesh, described.object)
            pose, (low, high) = np.eye(4), shape.bounds
        case _:
            raise TypeError(f"no volume for {type(described).__name__}")
    cube = np.diag([*(high - low), 1.0])
    cube[:3, 3] = low
    to_world = pose @ cube
    density: NDArray[np.float32] | None = None
    if described.density is not None:
        density = read_density(folder / described.density)
    elif described.structure is not None:
        density = described.structure.density(to_world)
    return Volume(
        described.name, medium, to_world, density, described.structure, shape=shape, carrier=carrier
    )


def closed(mesh: trimesh.Trimesh, name: str) -> trimesh.Trimesh:
    """A copy of a closed mesh with outward normals; InputError for an open one."""
    wrong = fault(mesh)
    if wrong not in (None, INVERTED):
        raise InputError(f"mesh {name!r} has {wrong}: a volume needs a closed surface")
    if not is_closed(mesh):
        raise InputError(f"mesh {name!r} is not closed: a volume needs a surface without holes")
    faces = mesh.faces[:, ::-1] if wrong == INVERTED else mesh.faces
    return trimesh.Trimesh(mesh.vertices, faces, process=False)


def warn_of_overlap(volumes: Sequence[Volume]) -> None:
    """SceneWarning for each pair of overlapping volumes, where both scatter."""
    for first, second in combinations(volumes, 2):
        if share_space(first, second):
            warnings.warn(
                f"volumes {first.name!r} and {second.name!r} overlap: their extinctions add where "
                "they do",
                SceneWarning,
                stacklevel=2,
            )


def share_space(first: Volume, second: Volume) -> bool:
    """Whether two volumes overlap, by random points; many triangles count as their bounds."""
    if not overlap(first.to_world, second.to_world):
        return False
    sizes = [0 if isinstance(each.shape, str) else len(each.shape.faces)
             for each in (first, second)]  # fmt: skip
    if first.shape == second.shape == "box" or max(sizes) > MAX_TRIANGLES:
        return True
    rng = np.random.default_rng(0)
    smaller, other = sorted((first, second), key=lambda each: abs(np.linalg.det(each.to_world)))
    points = rng.random((POINTS, 3)) @ smaller.to_world[:3, :3].T + smaller.to_world[:3, 3]
    return bool((contains(smaller, points) & contains(other, points)).any())


def contains(volume: Volume, points: Floats) -> NDArray[np.bool_]:
    """Whether world points (n, 3) lie in a volume, (n,)."""
    inverse = np.linalg.inv(volume.to_world)
    local = points @ inverse[:3, :3].T + inverse[:3, 3]
    inside = ((local >= 0) & (local <= 1)).all(axis=1)
    if volume.shape == "box":
        return inside
    if volume.shape == "ball":
        return np.asarray(np.sum((local - 0.5) ** 2, axis=1) <= 0.25)
    assert isinstance(volume.shape, trimesh.Trimesh)
    triangles = volume.shape.triangles
    for number in np.flatnonzero(inside):
        inside[number] = winding_number(points[number], triangles) > 0.5
    return inside


def _pose(described: BoxVolume | BallVolume | MeshVolume) -> Floats:
    return pose_matrix(described.rotate_deg, described.translate_m)


def _centred(size_m: Sequence[float]) -> tuple[Floats, Floats]:
    half = np.multiply(size_m, 0.5)
    return -half, half


def overlap(first: Floats, second: Floats) -> bool:
    """Whether two boxes, as (4, 4) poses of the unit cube, overlap.

    They are apart if they are so along a face normal of either, or along a vector normal to an edge
    of each (Gottschalk, Lin & Manocha 1996).
    """
    edges = [box[:3, :3].T for box in (first, second)]  # rows: three edge vectors
    centres = [box[:3, :3].sum(axis=1) / 2 + box[:3, 3] for box in (first, second)]
    axes = np.concatenate(
        [
            *(_face_normals(box) for box in edges),
            np.cross(edges[0][:, None], edges[1]).reshape(9, 3),
        ]
    )
    gaps = np.abs(axes @ (centres[1] - centres[0]))
    radii = sum(np.abs(axes @ box.T).sum(axis=1) / 2 for box in edges)
    # Parallel edges give no axis, only rounding.
    sizes = np.linalg.norm(edges[0], axis=1).max() * np.linalg.norm(edges[1], axis=1).max()
    real = np.linalg.norm(axes, axis=1) > TOUCHING * sizes
    return bool((gaps < (1 - TOUCHING) * radii)[real].all())


def _face_normals(edges: Floats) -> Floats:
    return np.cross(np.roll(edges, -1, axis=0), np.roll(edges, -2, axis=0))
