"""Solids as triangles, from which props are built; lengths in metres."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray
from trimesh.creation import box, capsule, cylinder, revolve

from reconstruction.base.arrays import Floats

Point: TypeAlias = Sequence[float] | Floats
Mesh: TypeAlias = trimesh.Trimesh


def block(size: Point, centre: Point) -> Mesh:
    """Return a box with this centre."""
    return moved(box(size), centre)


def rod(start: Point, end: Point, radius: float, sections: int) -> Mesh:
    """Round bar between two points."""
    return cylinder(radius, segment=[start, end], sections=sections)


def limb(start: Point, end: Point, radius: float) -> Mesh:
    """Bar with round ends between two points."""
    axis = np.subtract(end, start)
    body = capsule(float(np.linalg.norm(axis)), radius, count=(8, 10))
    body.apply_transform(trimesh.geometry.align_vectors((0, 0, 1), axis))
    return moved(body, np.add(start, end) / 2)


def lathe(profile: Iterable[Point], sections: int) -> Mesh:
    """Solid of revolution about z; `profile` lists (radius, height) from below upwards."""
    return revolve(np.asarray(list(profile)), sections=sections)


def prism(profile: Sequence[Point], width: float) -> Mesh:
    """Return a solid from its side view, (x, z) anticlockwise, `width` wide, centred on y = 0.

    All its points must be visible from their mean.
    """
    outline = np.asarray(profile, float)
    points = np.vstack([outline, outline.mean(axis=0)])
    sides = [np.insert(points, 1, y, axis=1) for y in (-width / 2, width / 2)]
    n = len(outline)
    one, other = np.arange(n), (np.arange(n) + 1) % n
    fan = np.stack([one, other, np.full(n, n)], axis=1)
    across = n + 1
    skirt = [
        np.stack([one, one + across, other + across], axis=1),
        np.stack([one, other + across, other], axis=1),
    ]
    return Mesh(np.vstack(sides), np.vstack([fan, fan[:, ::-1] + across, *skirt]), process=False)


def sheet(corners: ArrayLike) -> Mesh:
    """Two triangles between four corners (4, 3), listed around."""
    return Mesh(np.asarray(corners, float), [[0, 1, 2], [0, 2, 3]], process=False)


def strip(one: ArrayLike, other: ArrayLike) -> Mesh:
    """Sheet between two lines of as many points, (n, 3) each."""
    return grid_mesh(np.stack([np.asarray(one, float), np.asarray(other, float)], axis=1))


def grid_mesh(points: Floats) -> Mesh:
    """Sheet through a grid of points (n, m, 3)."""
    rows, columns = points.shape[:2]
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=None)
    return Mesh(points.reshape(-1, 3), faces.reshape(-1, 3), process=False)


def moved(mesh: Mesh, by: ArrayLike) -> Mesh:
    """The mesh itself, moved."""
    return mesh.apply_translation(by)


def union(parts: Sequence[Mesh]) -> Mesh:
    """All parts as one mesh."""
    return trimesh.util.concatenate(parts)


def alike(corners: Floats, faces: NDArray[np.int64]) -> Mesh:
    """Return many solids with the same triangles as one mesh: corners (n, v, 3), faces (f, 3)."""
    n, v, _ = corners.shape
    every = faces + v * np.arange(n)[:, None, None]
    return Mesh(corners.reshape(-1, 3), every.reshape(-1, 3), process=False)


def spread(mesh: Mesh, positions: ArrayLike, turns_deg: ArrayLike, scales: ArrayLike) -> Mesh:
    """Return copies of a solid as one mesh, at positions (n, 3), turned about z and scaled."""
    at = np.asarray(positions, float)
    turn = np.radians(np.broadcast_to(np.asarray(turns_deg, float), len(at)))
    scale = np.broadcast_to(np.asarray(scales, float), len(at))
    c, s, o, i = np.cos(turn), np.sin(turn), 0 * turn, 0 * turn + 1
    turned = np.array([[c, -s, o], [s, c, o], [o, o, i]]) * scale
    corners = np.einsum("ijn,vj->nvi", turned, mesh.vertices) + at[:, None]
    return alike(corners, np.asarray(mesh.faces))


def bars(segments: Sequence[Any] | Floats, radius: float, sections: int = 4) -> Mesh:
    """Return straight bars between pairs of points (n, 2, 3) as one mesh."""
    ends = np.asarray(segments, float)
    along = ends[:, 1] - ends[:, 0]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    helper = np.eye(3)[np.abs(along).argmin(axis=1)]
    across = np.cross(along, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(along, across)
    angles = np.linspace(0, 2 * np.pi, sections, endpoint=False) + np.pi / sections
    ring = radius * (
        np.cos(angles)[:, None] * across[:, None] + np.sin(angles)[:, None] * other[:, None]
    )
    corners = np.concatenate([ends[:, :1] + ring, ends[:, 1:] + ring, ends], axis=1)
    return alike(corners, _tube_faces(2, sections))


def tube(path: ArrayLike, radii: ArrayLike, sections: int = 8) -> Mesh:
    """Return a round closed tube along points, for wires, pipes and branches.

    `path` is (n, 3), and `radii` one value or one per point. Rings are perpendicular to the
    bisectors of the bends and carried along without twist (Wang et al. 2008, double reflection,
    here by rotations).
    """
    points = np.asarray(path, float)
    radius = np.broadcast_to(np.asarray(radii, float), (len(points),))
    along = np.diff(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    tangents = np.vstack([along[:1], along[:-1] + along[1:], along[-1:]])
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    helper = np.eye(3)[np.abs(tangents[0]).argmin()]
    across = np.cross(tangents[0], helper)
    angles = np.linspace(0, 2 * np.pi, sections, endpoint=False)
    rings = []
    for i, tangent in enumerate(tangents):
        across = across - (across @ tangent) * tangent
        across /= np.linalg.norm(across)
        round_ = np.outer(np.cos(angles), across) + np.outer(
            np.sin(angles), np.cross(tangent, across)
        )
        rings.append(points[i] + radius[i] * round_)
    return loft(np.array(rings))


def loft(rings: Floats) -> Mesh:
    """Return a closed surface through rings of corners (n, k, 3).

    Each ring is counter-clockwise as seen from the next one.
    """
    n, k, _ = rings.shape
    vertices = np.vstack([rings.reshape(-1, 3), rings[[0, -1]].mean(axis=1)])
    return Mesh(vertices, _tube_faces(n, k), process=False)


def _tube_faces(rings: int, sections: int) -> NDArray[np.int64]:
    """Return triangles, facing out, of rings of vertices followed by the centres of both ends."""
    ring = np.arange(sections)
    following = (ring + 1) % sections
    start = sections * np.arange(rings - 1)[:, None]
    near, near_next = start + ring, start + following
    far, far_next = near + sections, near_next + sections
    sides = [np.stack([near, near_next, far_next], -1), np.stack([near, far_next, far], -1)]
    last, first_centre = sections * (rings - 1), sections * rings
    ends = [
        np.stack([following, ring, np.full(sections, first_centre)], -1),
        np.stack([last + ring, last + following, np.full(sections, first_centre + 1)], -1),
    ]
    return np.concatenate([part.reshape(-1, 3) for part in (*sides, *ends)])
