"""A pose for the drone in an imported scene: in the open, looking at most of the scene."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene.blocks import Blocks
from spisim.scene.placing import MAX_COORDINATE_M
from spisim.scene.pose import look_at
from spisim.scene.rays import winding_number

#: Minimum distance to the nearest surface.
NEAREST_RANGE_M = (1.0, 10.0)
#: Candidate positions: distances from the target, directions, and heights above it.
DISTANCES_M = (4.0, 3.0, 5.0, 6.5, 2.0, 8.0, 1.5, 10.0, 12.0, 15.0, 20.0, 30.0)
AZIMUTHS_DEG = np.arange(180.0, 540.0, 30.0)  # first from -x, looking along x
ELEVATIONS_DEG = (10.0, 25.0, 45.0)
#: Minimum height over the lowest surface.
CLEARANCE_M = 0.3
SAMPLES = 20_000
#: Sample points of the bulk, and candidate positions to compare.
LOOKED_FOR = 32
TRIES = 30


@dataclass(frozen=True)
class DronePose:
    """Position and target of the drone in metres, with distances to surfaces."""

    position_m: Floats
    look_at_m: Floats
    why: str
    nearest_m: float  # to any surface
    ahead_m: float  # along the viewing direction, inf if nothing is hit


@dataclass(frozen=True, eq=False)
class Surroundings:
    """All meshes of a scene in world coordinates: their triangles, and bounds of each."""

    meshes: Sequence[trimesh.Trimesh]
    blocks: Blocks
    bounds_m: Floats  # (meshes, 2, 3)

    @classmethod
    def of(cls, meshes: Sequence[trimesh.Trimesh]) -> Surroundings:
        """Create from at least one mesh."""
        triangles = np.concatenate([mesh.triangles for mesh in meshes])
        bounds_m = np.array([mesh.bounds for mesh in meshes])
        return cls(meshes, Blocks.of(triangles), bounds_m)

    def is_open(self, position_m: ArrayLike) -> bool:
        """Return whether no mesh encloses a position, as checked when scenes are loaded."""
        position = np.asarray(position_m, float)
        low, high = self.bounds_m[:, 0], self.bounds_m[:, 1]
        around = np.flatnonzero(((low <= position) & (position <= high)).all(axis=1)).tolist()
        return all(winding_number(position, self.meshes[k].triangles) <= 0.5 for k in around)

    def bulk(self) -> Floats:
        """Return points (n, 3) on the surfaces, without floors unless there is nothing else.

        The number on a mesh grows with the root of its area.
        """
        sizes = self.bounds_m[:, 1] - self.bounds_m[:, 0]
        standing = np.flatnonzero(sizes[:, 2] > 0.01 * sizes[:, :2].max(axis=1))
        chosen = [self.meshes[k] for k in standing.tolist()] or self.meshes
        triangles = [mesh.triangles for mesh in chosen]
        areas = [mesh.area_faces for mesh in chosen]
        weights = np.concatenate([area / np.sqrt(area.sum()) for area in areas])
        rng = np.random.default_rng(0)
        result = rng.choice(len(weights), SAMPLES, p=weights / weights.sum())
        corners = np.concatenate(triangles)[result]
        return np.asarray(np.einsum("nc,nck->nk", rng.dirichlet((1, 1, 1), SAMPLES), corners))


def propose(around: Surroundings) -> DronePose:
    """Propose a pose outside of all meshes that sees much of their bulk from 1 to 10 m.

    Without such a pose, it is in front of the scene at any distance.
    """
    bulk = around.bulk()
    middle = np.median(bulk, axis=0)
    targets = (middle, bulk[np.linalg.norm(bulk - middle, axis=1).argmin()])  # if that is a hole
    looked_for = np.random.default_rng(0).permutation(bulk)[:LOOKED_FOR]
    lowest_m = around.bounds_m[:, 0, 2].min() + CLEARANCE_M
    near, far = NEAREST_RANGE_M
    fitting = (
        pose
        for target in targets
        for position in _positions(target)
        if position[2] >= lowest_m
        and near <= (pose := pose_at(around, position, target, "proposed")).nearest_m <= far
        and near <= pose.ahead_m <= far
    )
    while result := list(itertools.islice(fitting, TRIES)):
        result.sort(key=lambda pose: -_visible(around, pose.position_m, looked_for))
        for pose in result:
            if around.is_open(pose.position_m):
                return pose
    low, high = around.bounds_m[:, 0].min(axis=0), around.bounds_m[:, 1].max(axis=0)
    before = np.array([low[0] - max(3.0, 0.2 * float((high - low).max())), middle[1], middle[2]])
    why = "proposed in front of everything: no open place sees the bulk from 1 to 10 m"
    return pose_at(around, before, middle, why)


def aim(around: Surroundings, position_m: ArrayLike) -> Floats:
    """Return the target for a position: the bulk of the scene."""
    target = np.median(around.bulk(), axis=0)
    if np.abs(target - np.asarray(position_m, float)).max() < 1e-6:
        target[0] += 1.0
    return np.asarray(target)


def pose_at(
    around: Surroundings, position_m: ArrayLike, look_at_m: ArrayLike, why: str
) -> DronePose:
    """Return a pose with its distances. Raises InputError if it looks nowhere or straight up."""
    position, target = np.asarray(position_m, float), np.asarray(look_at_m, float)
    if not (np.abs([position, target]) <= MAX_COORDINATE_M).all():
        raise InputError(
            "position and look-at should be finite numbers within "
            f"±{MAX_COORDINATE_M:g} m of the scene's origin (see --origin)"
        )
    forward = look_at(position, target, (0.0, 0.0, 1.0))[:3, 2]
    ahead_m = float(around.blocks.first_hits(position, forward[None])[0])
    return DronePose(position, target, why, around.blocks.distance(position), ahead_m)


def _visible(around: Surroundings, position: Floats, points: Floats) -> float:
    """Return the fraction of surface points (n, 3) visible from a position within 10 m."""
    rays = points - position
    near = rays[np.linalg.norm(rays, axis=1) <= NEAREST_RANGE_M[1]]
    return float(np.sum(around.blocks.first_hits(position, near) > 0.99)) / len(points)


def _positions(target: Floats) -> Iterator[Floats]:
    for elevation in np.radians(ELEVATIONS_DEG):
        for distance_m in DISTANCES_M:
            for azimuth in np.radians(AZIMUTHS_DEG):
                across = np.cos(elevation)
                direction = [across * np.cos(azimuth), across * np.sin(azimuth), np.sin(elevation)]
                yield target + distance_m * np.array(direction)
