"""Exact geometric queries: hits along a ray, and objects that enclose a point."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.arrays import Floats
from spisim.scene.model import Scene

#: Pairs of rays and triangles per batch, which bounds the memory.
PAIRS = 2**20
#: Rounding error of a cosine.
ROUNDING = 1e-9


def first_hits(origin: Floats, rays: Floats, triangles: Floats) -> Floats:
    """First hit (n,) of each ray (n, 3) with triangles (t, 3, 3), in ray lengths; inf if none."""
    return first_met(origin, rays, triangles)[0]


def first_met(origin: Floats, rays: Floats, triangles: Floats) -> tuple[Floats, NDArray[np.int64]]:
    """`first_hits`, and the index of the triangle hit, -1 if none."""
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
        result = hits(origin, rays[start + ray], triangles[triangle])
        last = np.argsort(-result, kind="stable")  # so that the nearest one remains
        first[start + ray[last]], number[start + ray[last]] = result[last], triangle[last]
    return first, np.where(np.isfinite(first), number, -1)


def hits(origin: Floats, rays: Floats, triangles: Floats) -> Floats:
    """Hit (...) of each ray (..., 3) with its own triangle (..., 3, 3), in ray lengths, or inf.

    Möller & Trumbore, Fast, minimum storage ray-triangle intersection, J. Graph. Tools 2 (1997).
    """
    corner = triangles[..., 0, :]
    edge1, edge2 = triangles[..., 1, :] - corner, triangles[..., 2, :] - corner
    offset = origin - corner
    normal = _cross(offset, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / _dot(rays, _cross(edge2, edge1))
        u = _dot(rays, _cross(edge2, offset)) * scale
        v = _dot(rays, normal) * scale
        distance = _dot(edge2, normal) * scale
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0) & np.isfinite(distance)
    return np.where(met, distance, np.inf)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.einsum("...k,...k->...", a, b)


def _cross(a: Floats, b: Floats) -> Floats:
    """As numpy's, without its checks, which take longer than the product."""
    (ax, ay, az), (bx, by, bz) = (np.moveaxis(vector, -1, 0) for vector in (a, b))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def winding_number(point: ArrayLike, triangles: Floats) -> float:
    """Generalised winding number of triangles (t, 3, 3) around a point.

    1 inside a closed surface with outward normals, -1 with inward ones, 0 outside, in between for
    surfaces with holes (Jacobson, Kavan, Sorkine-Hornung 2013), from the signed solid angles of the
    triangles (Van Oosterom & Strackee 1983).
    """
    a, b, c = np.moveaxis(triangles - np.asarray(point, float), 1, 0)
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    volume = np.einsum("tk,tk->t", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("tk,tk->t", v, w) for v, w in ((a, b), (b, c), (c, a)))
    solid_angle = 2 * np.arctan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)
    return float(solid_angle.sum() / (4 * np.pi))


def enclosing_object(scene: Scene, point_m: Floats) -> str | None:
    """Name of an object that encloses a world point (3,) in metres, or None.

    A point is inside where the winding number exceeds ½, so meshes with gaps count too. A mesh with
    inward normals is a room, whose inside is free.
    """
    for scene_object in scene.objects:
        low, high = scene_object.mesh.bounds
        if (point_m < low).any() or (point_m > high).any():
            continue
        if winding_number(point_m, scene_object.mesh.triangles) > 0.5:
            return scene_object.name
    return None
