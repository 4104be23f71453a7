"""Rays of the drawings: the drone's view, and sections through the scene."""

from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport import RayCaster

Rays = tuple[Floats, Floats]  # origins and unit directions (n, 3), row by row

#: Maximum distance of a section's cut from the drone; it is at most halfway to a surface.
MAX_CUT_M = 1.0
CONE_RAYS = 64
CONE_TANGENT = 0.5


def perspective_rays(
    pose: Floats, shape: tuple[int, int], tan_half_width: float, tan_half_height: float
) -> Rays:
    """Return rays of a pinhole camera at a pose (4, 4), world from optical frame."""
    x, y = _centres(shape[1]) * tan_half_width, _centres(shape[0])[:, None] * tan_half_height
    right, down, ahead = pose[:3, :3].T
    directions = x[..., None] * right + (y[..., None] * down + ahead)
    directions /= np.sqrt(1 + x**2 + y**2)[..., None]
    directions = directions.reshape(-1, 3)
    return np.broadcast_to(pose[:3, 3], directions.shape), directions


@dataclass(frozen=True, eq=False)
class Section:
    """An orthographic view from a plane near the drone; everything before it is cut away.

    `across` and `up` are unit vectors of the drawing's axes in the world, from `origin` (3,), where
    both coordinates are 0.
    """

    origin: Floats
    across: Floats
    up: Floats

    @property
    def into(self) -> Floats:
        """Viewing direction."""
        return -np.cross(self.across, self.up)

    def project(self, points_m: Floats) -> Floats:
        """Return coordinates (..., 2) of world points (..., 3) in the drawing."""
        return np.asarray((points_m - self.origin) @ np.stack([self.across, self.up], axis=1))

    def rays(
        self, shape: tuple[int, int], limits: tuple[float, float, float, float], cut_m: float
    ) -> Rays:
        """Return rays of a drawing with `limits` (left, right, bottom, top), `cut_m` before it."""
        left, right, bottom, top = limits
        a = (left + right) / 2 + _centres(shape[1]) * (right - left) / 2
        b = (bottom + top) / 2 - _centres(shape[0]) * (top - bottom) / 2
        grid = np.stack(np.meshgrid(a, b), axis=-1).reshape(-1, 2)
        origins = self.origin - cut_m * self.into + grid @ np.stack([self.across, self.up])
        return origins, np.broadcast_to(self.into, origins.shape)


def heading(pose: Floats) -> Floats:
    """Return the horizontal unit vector of the drone's view, or of its image's top, if down."""
    forward, top = pose[:3, 2], -pose[:3, 1]
    level = forward if np.hypot(*forward[:2]) > 0.3 else top
    flat = np.array([level[0], level[1], 0.0])
    return np.asarray(flat / np.linalg.norm(flat))


def cut_m(caster: RayCaster, position_m: Floats, towards: Floats) -> float:
    """Return the distance of a section's cut from the drone, before any ceiling or wall."""
    turn = np.linspace(0, 2 * np.pi, CONE_RAYS, endpoint=False)
    one = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))])
    one /= np.linalg.norm(one)
    other = np.cross(towards, one)
    rays = towards + CONE_TANGENT * (np.outer(np.cos(turn), one) + np.outer(np.sin(turn), other))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    result = caster.along(np.broadcast_to(position_m, rays.shape), rays)
    distances = np.where(np.isfinite(result.range_m), result.range_m * (rays @ towards), np.inf)
    return float(min(MAX_CUT_M, np.median(distances) / 2))


def _centres(count: int) -> Floats:
    """Return centres of pixels from -1 to 1."""
    return np.asarray(2 * (np.arange(count) + 0.5) / count - 1)
