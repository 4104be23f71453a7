"""Exact geometry questions to a scene: what lies along a ray, what encloses a point."""

import numpy as np
from numpy.typing import ArrayLike

from reconstruction.arrays import Floats
from spisim.scene.model import Scene

#: Pairs of rays and triangles at a time, which bounds the memory.
PAIRS = 2**18


def first_hits(origin: Floats, rays: Floats, triangles: Floats) -> Floats:
    """First hit (n,) of each ray (n, 3) among triangles (t, 3, 3), in ray lengths, else inf."""
    count = max(1, PAIRS // max(1, len(triangles)))
    parts = [rays[start : start + count] for start in range(0, len(rays), count)]
    found = [hits(origin, part, triangles).min(axis=1, initial=np.inf) for part in parts]
    return np.concatenate([np.empty(0), *found])


def hits(origin: Floats, rays: Floats, triangles: Floats) -> Floats:
    """Where each ray (n, 3) meets each triangle (t, 3, 3), (n, t), in ray lengths, else inf.

    Möller & Trumbore (1997), with all products that are of triangles and origin alone done once.
    """
    corner = triangles[:, 0]
    edge1, edge2, offset = triangles[:, 1] - corner, triangles[:, 2] - corner, origin - corner
    normal = np.cross(offset, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / (rays @ np.cross(edge2, edge1).T)
        u = rays @ np.cross(edge2, offset).T * scale
        v = rays @ normal.T * scale
        distance = np.einsum("tk,tk->t", edge2, normal) * scale
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0) & np.isfinite(distance)
    return np.where(met, distance, np.inf)


def winding_number(point: ArrayLike, triangles: Floats) -> float:
    """How often a surface of triangles (t, 3, 3) wraps around a point.

    1 inside a closed surface whose normals face out, -1 where they face in, 0 outside, and a value
    between for a surface with holes (Jacobson, Kavan, Sorkine-Hornung 2013), from the signed
    solid angles of the triangles (Van Oosterom & Strackee 1983).
    """
    a, b, c = np.moveaxis(triangles - np.asarray(point, float), 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("tk,tk->t", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("tk,tk->t", v, w) for v, w in ((a, b), (b, c), (c, a)))
    solid_angle = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(solid_angle.sum() / (4 * np.pi))


def enclosing_object(scene: Scene, point_m: Floats) -> str | None:
    """Name of an object that a world point is inside of, or None.

    The inside is where the surface wraps the point more than half, so that meshes with gaps count
    too. A mesh with its normals facing in is a room, and a point inside it is in the open.
    """
    for scene_object in scene.objects:
        low, high = scene_object.mesh.bounds
        if (point_m < low).any() or (point_m > high).any():
            continue
        if winding_number(point_m, scene_object.mesh.triangles) > 0.5:
            return scene_object.name
    return None
