"""Distance of a drone to the surfaces of a scene, and to its bounds."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.scene import Scene, SceneObject

#: Size of a drone, which also keeps key poses, a step away, on its side of any surface.
CLEARANCE_M = 0.2
#: Distance beyond all surfaces at which the scene ends.
MARGIN_M = 15.0


class Obstacles:
    """The surfaces of a scene, still and moving."""

    def __init__(self, scene: Scene) -> None:
        still = [thing for thing in scene.objects if not thing.moves]
        self._still = _Surfaces(still) if still else None
        self._moving = [(thing, _Surfaces([thing])) for thing in scene.objects if thing.moves]
        bounds = np.array([thing.mesh.bounds for thing in scene.objects])
        self._low_m = bounds[:, 0].min(axis=0) - MARGIN_M
        self._high_m = bounds[:, 1].max(axis=0) + MARGIN_M

    def problem(self, position_m: Floats, time_s: float, gap_m: float = np.inf) -> str | None:
        """Why a drone cannot be at a position (3,), None if it can.

        `gap_m` is its previous distance: it may move away from what it is too close to.
        """
        distance_m, name = self.nearest(position_m, time_s)
        if distance_m < min(CLEARANCE_M, gap_m):
            return f"object {name!r} is less than {CLEARANCE_M:g} m away"
        if (position_m < self._low_m).any() or (position_m > self._high_m).any():
            return f"the scene ends {MARGIN_M:g} m beyond its surfaces"
        return None

    def nearest(self, position_m: Floats, time_s: float) -> tuple[float, str]:
        """Distance and name of the nearest surface; inf beyond `CLEARANCE_M`."""
        gaps = [self._still.nearest(position_m)] if self._still else []
        for thing, surfaces in self._moving:
            back = np.linalg.inv(thing.motion(time_s))
            gaps.append(surfaces.nearest(back[:3, :3] @ position_m + back[:3, 3]))
        return min(gaps)


class _Surfaces:
    """Triangles of some objects."""

    def __init__(self, things: list[SceneObject]) -> None:
        self._triangles: Floats = np.concatenate([thing.mesh.triangles for thing in things])
        sizes = [len(thing.mesh.faces) for thing in things]
        self._owners: NDArray[np.intp] = np.repeat(np.arange(len(things)), sizes)
        self._names = [thing.name for thing in things]
        self._low_m = self._triangles.min(axis=1) - CLEARANCE_M
        self._high_m = self._triangles.max(axis=1) + CLEARANCE_M

    def nearest(self, position_m: Floats) -> tuple[float, str]:
        """See `Obstacles`."""
        around = (position_m >= self._low_m).all(axis=1) & (position_m <= self._high_m).all(axis=1)
        near = np.flatnonzero(around)
        if not near.size:
            return np.inf, ""
        points = np.repeat(position_m[None], near.size, axis=0)
        closest = trimesh.triangles.closest_point(self._triangles[near], points)
        gaps = np.linalg.norm(closest - position_m, axis=1)
        return float(gaps.min()), self._names[self._owners[near[gaps.argmin()]]]
