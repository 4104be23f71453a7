"""Meshes that should be closed surfaces and are not, or face the wrong way, or are of odd sizes.

Daylight that the Earth does not have is told, too.

Every surface is lit and seen from both sides, so an unclosed mesh still renders. But it has no
inside: glass has no thickness there, and nobody can tell whether the drone is in it.
"""

import warnings

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.scene.model import Scene, SceneObject, SceneWarning
from spisim.scene.rays import winding_number

#: Narrower than this is nothing that a drone meets.
THIN_M = 0.001
#: Beyond this single precision, in which light is traced, is poor: it tells 1 mm apart.
FAR_M = 10_000.0
#: The sun above the atmosphere gives a surface that faces it 134 klx.
MAX_KLX = 150.0


def warn_of_unsound_meshes(scene: Scene) -> None:
    """One SceneWarning that names every object with such a mesh, and what is wrong with it.

    Sheets are fine, and so is a room: a closed mesh that faces in, with the drone inside.
    """
    originals = {id(mesh): mesh for mesh in map(_original, scene.objects)}
    estimated_in = {key: fault(mesh) for key, mesh in originals.items()}
    faults = {thing.name: estimated_in[id(_original(thing))] for thing in scene.objects}
    for thing in scene.objects:
        if faults[thing.name] == INVERTED:
            wraps = winding_number(scene.drone_pose[:3, 3], thing.mesh.triangles)
            faults[thing.name] = None if wraps < -0.5 else INVERTED
    reported = [f"{name!r} ({result})" for name, result in faults.items() if result]
    if reported:
        warnings.warn(
            f"scene {scene.name!r}: these meshes are not closed surfaces: {', '.join(reported)}; "
            "they are drawn from both sides, but have no inside",
            SceneWarning,
            stacklevel=2,
        )


def _original(thing: SceneObject) -> trimesh.Trimesh:
    """What a copy is sound or unsound with."""
    return thing.mesh if thing.original is None else thing.original


def warn_of_odd_sizes(scene: Scene) -> None:
    """One SceneWarning that names whatever is of a size or at a position that no drone meets."""
    sizes = {thing.name: float(thing.mesh.extents.max()) for thing in scene.objects}
    away = {"the drone": float(np.abs(scene.drone_pose[:3, 3]).max())}
    away |= {repr(thing.name): float(np.abs(thing.mesh.bounds).max()) for thing in scene.objects}
    reported = [f"{name!r} is {size:.3g} m wide" for name, size in sizes.items() if size < THIN_M]
    reported += [
        f"{name} is {far:.3g} m from the origin" for name, far in away.items() if far > FAR_M
    ]
    if reported:
        warnings.warn(
            f"scene {scene.name!r}: {', '.join(reported)}; all lengths are metres; `scale: 0.001` "
            "makes metres of a mesh in millimetres",
            SceneWarning,
            stacklevel=2,
        )


def warn_of_odd_daylight(scene: Scene) -> None:
    """SceneWarning of a sun that is brighter than ours, and of one below the horizon."""
    ambient = scene.ambient
    reported = [
        f"{name} {value:g} is more than the {MAX_KLX:g} klx that daylight has at most"
        for name, value in (("sun_klx", ambient.sun_klx), ("sky_klx", ambient.sky_klx))
        if value > MAX_KLX
    ]
    if ambient.sun_klx > 0 and ambient.sun_direction[2] > 0:
        reported.append(
            "sun_direction goes upwards: it is from the sun into the scene, so the sun stands "
            "below the horizon"
        )
    if reported:
        warnings.warn(f"scene {scene.name!r}: {'; '.join(reported)}", SceneWarning, stacklevel=2)


NON_MANIFOLD = "edges shared by more than two triangles"
INCONSISTENT = "triangles facing in and out"
INVERTED = "inside out"


def fault(mesh: trimesh.Trimesh) -> str | None:
    """What is wrong with a mesh as a closed surface, or None; open sheets have nothing wrong.

    Solids that touch along an edge share it among four triangles or more, but as many run along it
    one way as the other: those are sound.
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
    """Whether as many triangles run along every edge one way as the other."""
    triangles, balance = _edge_counts(mesh)
    return bool((balance == 0).all() and (triangles > 1).all())


def _volume_and_area(triangles: Floats) -> tuple[float, float]:
    """Volume that closed triangles (t, 3, 3) enclose, negative if they face in, and their area."""
    corner = triangles[:, 0] - triangles[0, 0]  # near the origin, which keeps digits
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    volume = np.einsum("tk,tk->", corner, across) / 6
    return float(volume), float(np.linalg.norm(across, axis=1).sum() / 2)


def _edge_counts(mesh: trimesh.Trimesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Per edge: how many triangles share it, and how many more run along it one way.

    Vertices in the same place are one: files repeat them where normals or textures change.
    """
    _, same = trimesh.grouping.unique_rows(mesh.vertices)
    faces = same[mesh.faces]
    directed = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    directed = directed[directed[:, 0] != directed[:, 1]]
    forward = directed[:, 0] < directed[:, 1]
    keys = directed.min(axis=1) * len(mesh.vertices) + directed.max(axis=1)
    _, edge = np.unique(keys, return_inverse=True)
    triangles = np.bincount(edge)
    return triangles, 2 * np.bincount(edge[forward], minlength=len(triangles)) - triangles
