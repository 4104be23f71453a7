"""A place for the drone in an imported scene: in the open, looking at the bulk of it."""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from scipy.spatial import KDTree

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.scene.pose import look_at
from spisim.scene.rays import first_hits, winding_number

#: How near the nearest surface may be.
NEAREST_RANGE_M = (1.0, 10.0)
#: Where to look from: distances from the target, directions about it, and heights above it.
DISTANCES_M = (4.0, 3.0, 5.0, 6.5, 2.0, 8.0, 1.5, 10.0, 12.0, 15.0, 20.0, 30.0)
AZIMUTHS_DEG = np.arange(180.0, 540.0, 30.0)  # first from -x, looking along x
ELEVATIONS_DEG = (10.0, 25.0, 45.0)
#: Height over the lowest surface that the drone should keep.
CLEARANCE_M = 0.3
SAMPLES = 20_000
#: Points of the bulk to be seen, and rays times triangles to be tested in search of the best view.
LOOKED_FOR = 32
MAX_TESTS = 1e7


@dataclass(frozen=True)
class DronePose:
    """Where the drone is and what it looks at, metres, with the distances to what is there."""

    position_m: Floats
    look_at_m: Floats
    why: str
    nearest_m: float  # to any surface
    ahead_m: float  # along the line of sight, inf where nothing is hit


def propose(meshes: Sequence[trimesh.Trimesh]) -> DronePose:
    """A pose outside of all meshes (world coordinates) that sees much of their bulk from 1 to 10 m.

    Where no such place is found, one in front of the scene, at whatever distance.
    """
    points = _samples(meshes)
    bulk = _samples(_upright(meshes))
    target = np.median(bulk, axis=0)
    seen = np.random.default_rng(0).permutation(bulk)[:LOOKED_FOR]
    triangles = sum(len(mesh.faces) for mesh in meshes)
    tries = int(np.clip(MAX_TESTS / (LOOKED_FOR * triangles), 1, 30))
    fitting = (
        pose
        for position in _roomy(_places(target), points)
        if is_open(meshes, position)
        and (pose := pose_at(meshes, position, target, "proposed")).nearest_m >= NEAREST_RANGE_M[0]
        and NEAREST_RANGE_M[0] <= pose.ahead_m <= NEAREST_RANGE_M[1]
    )
    if found := list(itertools.islice(fitting, tries)):
        if len(found) == 1:
            return found[0]
        return max(found, key=lambda pose: _visible(meshes, pose.position_m, seen))
    low, high = points.min(axis=0), points.max(axis=0)
    before = np.array([low[0] - max(3.0, 0.2 * float((high - low).max())), target[1], target[2]])
    why = "proposed in front of everything: no open place sees the bulk from 1 to 10 m"
    return pose_at(meshes, before, target, why)


def aim(meshes: Sequence[trimesh.Trimesh], position_m: ArrayLike) -> Floats:
    """What to look at from a position: the bulk of the scene."""
    target = np.median(_samples(_upright(meshes)), axis=0)
    if np.linalg.norm(target - np.asarray(position_m, float)) < 1e-6:
        target[0] += 1.0
    return np.asarray(target)


def pose_at(
    meshes: Sequence[trimesh.Trimesh], position_m: ArrayLike, look_at_m: ArrayLike, why: str
) -> DronePose:
    """A pose with its distances; InputError for a line of sight that is none, or straight up."""
    position, target = np.asarray(position_m, float), np.asarray(look_at_m, float)
    if not (np.isfinite(position).all() and np.isfinite(target).all()):
        raise InputError("position and look-at should be finite numbers")
    forward = look_at(position, target, (0.0, 0.0, 1.0))[:3, 2]
    ahead_m = min(float(first_hits(position, forward[None], m.triangles)[0]) for m in meshes)
    nearest_m = min(distance(position, mesh.triangles) for mesh in meshes)
    return DronePose(position, target, why, nearest_m, ahead_m)


def is_open(meshes: Sequence[trimesh.Trimesh], position_m: ArrayLike) -> bool:
    """Whether no mesh encloses a position, as scenes are checked when they are loaded."""
    return all(winding_number(position_m, mesh.triangles) <= 0.5 for mesh in meshes)


def distance(point: Floats, triangles: Floats) -> float:
    """Distance of a point (3,) from the nearest of triangles (t, 3, 3), m.

    The nearest point of a triangle lies within it or on an edge.
    """
    a, b, c = np.moveaxis(triangles, 1, 0)
    edges = min(_from_segments(point, *ends).min() for ends in ((a, b), (b, c), (c, a)))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    flat = length > 0
    a, b, c = a[flat], b[flat], c[flat]
    normal = normal[flat] / length[flat, None]
    inside = np.ones(len(a), bool)
    for start, stop in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("tk,tk->t", np.cross(stop - start, point - start), normal) >= 0
    heights = np.abs(np.einsum("tk,tk->t", point - a, normal))[inside]
    return float(min(edges, heights.min(initial=np.inf)))


def _from_segments(point: Floats, start: Floats, stop: Floats) -> Floats:
    along = stop - start
    length2 = np.einsum("tk,tk->t", along, along)
    where = np.einsum("tk,tk->t", point - start, along) / np.where(length2 > 0, length2, 1.0)
    closest = start + np.clip(where, 0, 1)[:, None] * along
    return np.asarray(np.linalg.norm(point - closest, axis=1))


def _roomy(places: Iterable[Floats], points: Floats) -> Iterator[Floats]:
    """Places over the lowest of points on the surfaces, and neither too near to them nor too far.

    Points overestimate the distance to the surfaces: this only sorts places out.
    """
    tree = KDTree(points)
    lowest_m = points[:, 2].min() + CLEARANCE_M
    for place in places:
        if (
            place[2] >= lowest_m
            and NEAREST_RANGE_M[0] <= float(tree.query(place)[0]) <= NEAREST_RANGE_M[1]
        ):
            yield place


def _visible(meshes: Sequence[trimesh.Trimesh], position: Floats, points: Floats) -> float:
    """Fraction of points (n, 3) on the surfaces that a position sees from at most 10 m."""
    rays = points - position
    first = np.min([first_hits(position, rays, mesh.triangles) for mesh in meshes], axis=0)
    return float(np.mean((first > 0.99) & (np.linalg.norm(rays, axis=1) <= NEAREST_RANGE_M[1])))


def _places(target: Floats) -> Iterator[Floats]:
    for elevation in np.radians(ELEVATIONS_DEG):
        for distance_m in DISTANCES_M:
            for azimuth in np.radians(AZIMUTHS_DEG):
                across = np.cos(elevation)
                direction = [across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)]
                yield target + distance_m * np.array(direction)


def _upright(meshes: Sequence[trimesh.Trimesh]) -> list[trimesh.Trimesh]:
    """The meshes without floors, unless there is nothing else."""
    standing = [mesh for mesh in meshes if mesh.extents[2] > 0.01 * mesh.extents[:2].max()]
    return standing or list(meshes)


def _samples(meshes: Sequence[trimesh.Trimesh]) -> Floats:
    """Points on the surfaces (n, 3), more on larger meshes, as the root of their areas."""
    weights = np.sqrt([mesh.area for mesh in meshes])
    counts = np.maximum(1, SAMPLES * weights / weights.sum()).astype(int)
    rng = np.random.default_rng(0)
    points = [
        trimesh.sample.sample_surface(mesh, int(count), seed=rng)[0]
        for mesh, count in zip(meshes, counts, strict=True)
    ]
    return np.concatenate(points)
