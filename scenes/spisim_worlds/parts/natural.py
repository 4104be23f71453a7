"""Objects without straight edges: stones, lumps, clipped bushes; lengths in metres."""

import numpy as np
from trimesh.creation import icosahedron, icosphere
from trimesh.transformations import random_rotation_matrix

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.plants import blades
from spisim_worlds.parts.shapes import Mesh, Point, alike


def scattered_rocks(rng: np.random.Generator, positions: Floats, sizes: Floats) -> Mesh:
    """Return broken stones at positions (n, 3), of sizes (n,), each of its own shape."""
    one = icosahedron()
    n = len(positions)
    stretch = sizes[:, None] * rng.uniform((0.8, 0.6, 0.4), (1.2, 1.0, 0.8), (n, 3)) / 2
    corners = one.vertices * rng.uniform(0.7, 1.15, (n, 12, 1)) * stretch[:, None]
    turns = [random_rotation_matrix(row)[:3, :3] for row in rng.random((n, 3))]
    return alike(
        np.einsum("nij,nvj->nvi", np.array(turns), corners) + positions[:, None], one.faces
    )


def blob(rng: np.random.Generator, size: Point, relief: float, detail: int = 3) -> Mesh:
    """Bumpy ellipsoid centred on the origin; bumps up to about `relief` of its radius."""
    mesh = icosphere(detail, 0.5)
    waves = rng.normal(scale=9.0, size=(6, 3))
    phases = rng.uniform(0, 2 * np.pi, 6)
    bumps = np.cos(mesh.vertices @ waves.T + phases).sum(axis=1)
    mesh.vertices *= (1 + relief * bumps / 3)[:, None] * np.asarray(size)
    return mesh


def clipped_bush(
    rng: np.random.Generator, size: Point, leaf: float, count: int
) -> tuple[Mesh, Mesh]:
    """A bumpy body centred on the origin, and `count` leaves all over it."""
    body = blob(rng, size, 0.15, 2)
    picked = rng.choice(len(body.faces), count, p=body.area_faces / body.area)
    weights = rng.dirichlet((1, 1, 1), count)
    positions = np.einsum("nk,nkd->nd", weights, body.triangles[picked])
    return body, blades(rng, positions, body.face_normals[picked], leaf)
