"""What remembered points say of the corridor ahead: where one lies in it, it is not free beyond.

The map alone misses what is small, or looks like what is behind it; a spot has met it. Nothing is
sure: what was met may have moved on, or lie beside the corridor by an error of pose.
"""

import json
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats
from ...capture.motion import PoseAt
from ..obstacle import CORRIDOR_M, DISTANCES_M, FORWARD, axes_along
from .correction import FITTED
from .points import Points


@dataclass(frozen=True)
class MetObstacles:
    """Constants fitted by `tools/flight_memory.py`.

    ``certainty`` is the probability that a point just met in the corridor is an obstacle, which
    falls by e in ``lasting_s``.
    """

    certainty: float
    lasting_s: float


@cache
def fitted_obstacles() -> MetObstacles:
    """Constants fitted to flights."""
    return MetObstacles(**json.loads(FITTED.read_text())["obstacles"])


class LocalPoints(NamedTuple):
    """Remembered points (N, 3) in the optical frame of a pose, and their age (N,) in seconds."""

    position_m: Floats
    age_s: Floats


class Met(NamedTuple):
    """Distance (n,) along a corridor and age (n,) in seconds of the points that lie in it."""

    depth_m: Floats
    age_s: Floats


def local_points(points: Points, pose: PoseAt) -> LocalPoints:
    """All points as a pose has them, in view or not."""
    local_m = (points.position_m - pose.position_m) @ pose.axes
    return LocalPoints(local_m, pose.time_s - points.time_s)


def met_in_corridor(points: LocalPoints, direction: Floats = FORWARD) -> Met:
    """Points in the corridor along a unit vector (3,), in view or not."""
    along_m = points.position_m @ axes_along(direction)
    inside = np.abs(along_m[:, :2]).max(axis=1, initial=0.0) < CORRIDOR_M / 2
    inside &= along_m[:, 2] > 0
    return Met(along_m[inside, 2], points.age_s[inside])


def free_of_met(met: Met, constants: MetObstacles | None = None) -> Floats:
    """Probability (K,) that none of these blocks the corridor up to each of `DISTANCES_M`."""
    constants = constants or fitted_obstacles()
    certain = constants.certainty * np.exp(-met.age_s / constants.lasting_s)
    blocked = np.where(met.depth_m[:, None] < DISTANCES_M, certain[:, None], 0.0)
    return np.asarray(1 - blocked.max(axis=0, initial=0.0))
