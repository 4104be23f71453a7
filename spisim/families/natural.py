"""Things without edges: stones, bushes, leaves; lengths in metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from trimesh.creation import icosahedron, icosphere
from trimesh.transformations import random_rotation_matrix

from spisim.families.shapes import Mesh, Point, alike

Points = NDArray[np.float64]


def scattered_rocks(rng: np.random.Generator, places: Points, sizes: Points) -> Mesh:
    """Broken stones at places (n, 3), of sizes (n,), each of a shape and turned its own way."""
    one = icosahedron()
    n = len(places)
    stretch = sizes[:, None] * rng.uniform((0.8, 0.6, 0.4), (1.2, 1.0, 0.8), (n, 3)) / 2
    corners = one.vertices * rng.uniform(0.7, 1.15, (n, 12, 1)) * stretch[:, None]
    turns = [random_rotation_matrix(row)[:3, :3] for row in rng.random((n, 3))]
    return alike(np.einsum("nij,nvj->nvi", np.array(turns), corners) + places[:, None], one.faces)


def blob(rng: np.random.Generator, size: Point, relief: float, detail: int = 3) -> Mesh:
    """Bumpy ellipsoid centred on the origin; bumps up to about `relief` of its radius."""
    mesh = icosphere(detail, 0.5)
    waves = rng.normal(scale=9.0, size=(6, 3))
    phases = rng.uniform(0, 2 * np.pi, 6)
    bumps = np.cos(mesh.vertices @ waves.T + phases).sum(axis=1)
    mesh.vertices *= (1 + relief * bumps / 3)[:, None] * np.asarray(size)
    return mesh


def bush(rng: np.random.Generator, size: Point, leaf: float, count: int) -> tuple[Mesh, Mesh]:
    """A bumpy body centred on the origin, and `count` sheets of leaves all over it."""
    body = blob(rng, size, 0.15, 2)
    picked = rng.choice(len(body.faces), count, p=body.area_faces / body.area)
    weights = rng.dirichlet((1, 1, 1), count)
    places = np.einsum("nk,nkd->nd", weights, body.triangles[picked])
    return body, leaves(rng, places + body.face_normals[picked] * leaf / 4, leaf)


def leaves(rng: np.random.Generator, places: Points, size: float) -> Mesh:
    """One four-cornered sheet per place (n, 3), twice as long as wide, turned at random."""
    long = _directions(rng, len(places))
    wide = np.cross(long, _directions(rng, len(places)))
    wide /= np.linalg.norm(wide, axis=1, keepdims=True)
    lengths = size * rng.uniform(0.7, 1.3, (len(places), 1))
    long, wide = long * lengths / 2, wide * lengths / 4
    corners = np.stack([places - long, places + wide, places + long, places - wide], axis=1)
    first = 4 * np.arange(len(places))[:, None]
    faces = np.concatenate([np.add(first, (0, 1, 2)), np.add(first, (0, 2, 3))])
    return Mesh(corners.reshape(-1, 3), faces, process=False)


def grid_mesh(points: Points) -> Mesh:
    """Sheet through a grid of points (n, m, 3)."""
    rows, columns = points.shape[:2]
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=None)
    return Mesh(points.reshape(-1, 3), faces.reshape(-1, 3), process=False)


def _directions(rng: np.random.Generator, count: int) -> Points:
    vectors = rng.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
