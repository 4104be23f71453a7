"""Warnings about meshes that are not closed, face inward or have odd sizes, and odd daylight.

Surfaces are lit and seen from both sides, so an open mesh still renders. But it has no inside:
glass has no thickness there, and whether the drone is inside is undefined.
"""

import warnings

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.scene.model import Scene, SceneObject, SceneWarning
from spisim.scene.rays import winding_number

#: Minimum size of things that a drone meets.
MIN_SIZE_M = 0.001
#: Maximum distance at which single precision, used for tracing, resolves 1 mm.
MAX_DISTANCE_M = 10_000.0
#: Solar illuminance above the atmosphere is 134 klx.
MAX_KLX = 150.0


def warn_of_unsound_meshes(scene: Scene) -> None:
    """One SceneWarning for all unsound meshes but rooms: inward normals around the drone."""
    originals = {id(mesh): mesh for mesh in map(_original, scene.objects)}
    faults_by_mesh = {key: fault(mesh) for key, mesh in originals.items()}
    faults = {thing.name: faults_by_mesh[id(_original(thing))] for thing in scene.objects}
    for thing in scene.objects:
        if faults[thing.name] == INVERTED:
            wraps = winding_number(scene.drone_pose[:3, 3], thing.mesh.triangles)
            faults[thing.name] = None if wraps < -0.5 else INVERTED
    oddities = [f"{name!r} ({reason})" for name, reason in faults.items() if reason]
    if oddities:
        warnings.warn(
            f"scene {scene.name!r}: these meshes are not closed surfaces: {', '.join(oddities)}; "
            "they are drawn from both sides, but have no inside",
            SceneWarning,
            stacklevel=2,
        )


def _original(thing: SceneObject) -> trimesh.Trimesh:
    """The mesh that decides whether a copy is sound."""
    return thing.mesh if thing.original is None else thing.original


def warn_of_odd_sizes(scene: Scene) -> None:
    """One SceneWarning for everything of an implausible size or position."""
    sizes = {thing.name: float(thing.mesh.extents.max()) for thing in scene.objects}
    away = {"the drone": float(np.abs(scene.drone_pose[:3, 3]).max())}
    away |= {repr(thing.name): float(np.abs(thing.mesh.bounds).max()) for thing in scene.objects}
    oddities = [
        f"{name!r} is {size:.3g} m wide" for name, size in sizes.items() if size < MIN_SIZE_M
    ]
    oddities += [
        f"{name} is {far:.3g} m from the origin"
        for name, far in away.items()
        if far > MAX_DISTANCE_M
    ]
    if oddities:
        warnings.warn(
            f"scene {scene.name!r}: {', '.join(oddities)}; all lengths are metres; `scale: 0.001` "
            "makes metres of a mesh in millimetres",
            SceneWarning,
            stacklevel=2,
        )


def warn_of_odd_daylight(scene: Scene) -> None:
    """SceneWarning for a sun brighter than ours or below the horizon."""
    ambient = scene.ambient
    oddities = [
        f"{name} {value:g} is more than the {MAX_KLX:g} klx that daylight has at most"
        for name, value in (("sun_klx", ambient.sun_klx), ("sky_klx", ambient.sky_klx))
        if value > MAX_KLX
    ]
    if ambient.sun_klx > 0 and ambient.sun_direction[2] > 0:
        oddities.append(
            "sun_direction goes upwards: it is from the sun into the scene, so the sun stands "
            "below the horizon"
        )
    if oddities:
        warnings.warn(f"scene {scene.name!r}: {'; '.join(oddities)}", SceneWarning, stacklevel=2)


NON_MANIFOLD = "edges shared by more than two triangles"
INCONSISTENT = "triangles facing in and out"
INVERTED = "inside out"


def fault(mesh: trimesh.Trimesh) -> str | None:
    """Fault of a mesh as a closed surface, or None; open sheets have none.

    Solids that touch along an edge share it among four triangles or more, with equally many in both
    directions; those are sound.
    """
    triangles, balance = _edge_counts(mesh)
    paired = balance == 0
    if ((triangles > 2) & ~paired).any():
        return NON_MANIFOLD
    if (triangles < 2).any():
        return None
    if not paired.all():
        return INCONSISTENT
    volume, area = _volume_and_area(mesh.triangles)
    return INVERTED if volume < -1e-9 * area**1.5 else None


def is_closed(mesh: trimesh.Trimesh) -> bool:
    """Whether equally many triangles run along every edge in both directions."""
    triangles, balance = _edge_counts(mesh)
    return bool((balance == 0).all() and (triangles > 1).all())


def _volume_and_area(triangles: Floats) -> tuple[float, float]:
    """Volume enclosed by triangles (t, 3, 3), negative if they face in, and their area."""
    corner = triangles[:, 0] - triangles[0, 0]  # near the origin, for precision
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    volume = np.einsum("tk,tk->", corner, across) / 6
    return float(volume), float(np.linalg.norm(across, axis=1).sum() / 2)


def _edge_counts(mesh: trimesh.Trimesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Per edge of triangles of distinct points: how many, and the surplus in one direction."""
    _, same = trimesh.grouping.unique_rows(mesh.vertices)
    faces = same[mesh.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]  # others are no surface
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    forward = directed[:, 0] < directed[:, 1]
    keys = directed.min(axis=1) * len(mesh.vertices) + directed.max(axis=1)
    _, edge = np.unique(keys, return_inverse=True)
    triangles = np.bincount(edge)
    return triangles, 2 * np.bincount(edge[forward], minlength=len(triangles)) - triangles
