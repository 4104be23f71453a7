"""Exact geometry questions to a scene: what lies along a ray, what encloses a point."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.arrays import Floats
from spisim.scene.model import Scene

#: Pairs of rays and triangles at a time, which bounds the memory.
PAIRS = 2**20
#: Of a cosine.
ROUNDING = 1e-9


def first_hits(origin: Floats, rays: Floats, triangles: Floats) -> Floats:
    """First hit (n,) of each ray (n, 3) among triangles (t, 3, 3), in ray lengths, else inf."""
    return first_met(origin, rays, triangles)[0]


def first_met(origin: Floats, rays: Floats, triangles: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """First hit (n,) of each ray as `first_hits`, and the number of its triangle, -1 for none.

    Only those triangles are tried whose bounding sphere a ray passes through.
    """
    first, number = np.full(len(rays), np.inf), np.full(len(rays), -1)
    if not len(triangles):
        return first, number
    centre = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - centre[:, None], axis=2).max(axis=1)
    towards = centre - origin
    distance = np.linalg.norm(towards, axis=1)
    narrow = distance > radius
    towards = towards / np.where(distance > 0, distance, 1)[:, None]
    minimum = np.full(len(triangles), -np.inf)  # cosine of the sphere's half-angle
    minimum[narrow] = np.sqrt(1 - (radius[narrow] / distance[narrow]) ** 2) - ROUNDING
    units = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    count = max(1, PAIRS // len(triangles))
    for start in range(0, len(rays), count):
        ray, triangle = np.nonzero(units[start : start + count] @ towards.T >= minimum)
        result = _hits(origin, rays[start + ray], triangles[triangle])
        last = np.argsort(-result, kind="stable")  # the nearest is written last
        first[start + ray[last]], number[start + ray[last]] = result[last], triangle[last]
    return first, np.where(np.isfinite(first), number, -1)


def _hits(origin: Floats, rays: Floats, triangles: Floats) -> Floats:
    """Where each ray (n, 3) meets its triangle (n, 3, 3), (n,), in ray lengths, else inf.

    Möller & Trumbore (1997).
    """
    corner = triangles[:, 0]
    edge1, edge2, offset = triangles[:, 1] - corner, triangles[:, 2] - corner, origin - corner
    normal = np.cross(offset, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / np.einsum("nk,nk->n", rays, np.cross(edge2, edge1))
        u = np.einsum("nk,nk->n", rays, np.cross(edge2, offset)) * scale
        v = np.einsum("nk,nk->n", rays, normal) * scale
        distance = np.einsum("nk,nk->n", edge2, normal) * scale
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
