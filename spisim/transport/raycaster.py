"""Ray casting without light: what lies along rays, and how its surfaces are shaded."""

from dataclasses import dataclass
from typing import Self

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.scene import Scene, SceneObject
from spisim.transport.backend import with_backend
from spisim.transport.bsdf import is_null_transmitting
from spisim.transport.geometry import rays_of
from spisim.transport.jit import Float, Hit, Ray
from spisim.transport.meshes import Meshes
from spisim.transport.sight import brightest

#: Maximum number of surfaces or panes along a line of sight.
MAX_PANES = 8
#: Minimum fraction of a ray's light that is followed through a pane.
MIN_LEFT = 0.02
#: Rays that sample how much of the sky is hidden, and their maximum range. Neighbours continue one
#: sequence, so that the mean over nearby pixels samples the sky evenly.
SKY_RAYS = 8
SKY_MAX_RANGE_M = 2.0
#: Steps of Roberts' R2 sequence of the plastic number, which fills the square evenly, in 2^-32.
PLASTIC = tuple(round(step * 2**32) for step in (0.7548776662, 0.5698402910))
#: Maximum number of rays at a time, which bounds the memory.
RAYS_AT_A_TIME = 2**20


@dataclass(frozen=True, eq=False)
class Surfaces:
    """The surface that each of n rays sees."""

    range_m: Floats  # (n,), inf where there is none
    object_id: NDArray[np.int64]  # (n,), index into the scene's objects; -1 where there is none


@dataclass(frozen=True, eq=False)
class RayCaster:
    """The surfaces of a scene, for rays with origins and unit directions (n, 3) in the world.

    Parameters
    ----------
    scene
        Its objects are the surfaces.
    meshes
        The same surfaces as Mitsuba meshes; `RayCaster.of` builds them.
    """

    scene: Scene
    meshes: Meshes

    @classmethod
    @with_backend
    def of(cls, scene: Scene) -> Self:
        """Build the ray caster of a scene."""
        return cls(scene, Meshes.of(scene.objects))

    @with_backend
    def along(self, origins: Floats, directions: Floats) -> Surfaces:
        """Range and object of the surface that each ray (n, 3) sees, as in `ground_truth`."""
        rays = rays_of(origins, directions)
        si = brightest(self.meshes, rays, rays.o)
        distance = dr.select(si.is_valid(), si.t, dr.inf)
        return Surfaces(np.asarray(distance.numpy(), dtype=np.float64), self.meshes.object_ids(si))

    @with_backend
    def shaded(self, origins: Floats, directions: Floats) -> NDArray[np.float32]:
        """Brightness of what each ray sees, as a drawing without light transport.

        It is the reflectance under an even sky that near objects hide, darker where a surface is
        seen at a slant. Rays pass through panes.
        Returns (n,) values from 0 to 1; nan where a ray meets nothing.
        """
        steps = MAX_PANES if any(map(_is_pane, self.scene.objects)) else 1
        reflectance = np.array([thing.material.reflectance for thing in self.scene.objects] + [0.0])
        parts = []
        for start in range(0, len(origins), RAYS_AT_A_TIME):
            part = slice(start, start + RAYS_AT_A_TIME)
            ray = rays_of(origins[part], directions[part])
            parts.append(self._shade(ray, steps, reflectance))
        return np.concatenate(parts)

    def _shade(self, ray: Ray, steps: int, reflectance: Floats) -> NDArray[np.float32]:
        count = dr.width(ray.d)
        seen, weight, left = np.zeros(count), np.zeros(count), np.ones(count)
        lanes = np.arange(count)  # of the rays that are on their way
        for _ in range(steps):
            si = self.meshes.scene.ray_intersect(ray)
            ids = self.meshes.object_ids(si)
            passed = np.zeros(1)
            if steps > 1:
                passed = si.bsdf().eval_null_transmission(si, si.is_valid()).x.numpy()
            through = np.where(ids >= 0, left[lanes] * passed, 0.0)
            fraction = np.where(ids >= 0, left[lanes] - through, 0.0)
            seen[lanes] += fraction * np.sqrt(reflectance[ids]) * self._sky(si)
            weight[lanes] += fraction
            left[lanes] = through
            going = np.flatnonzero(through >= MIN_LEFT)
            if not len(going):
                break
            lanes = lanes[going]
            ray = dr.gather(mi.Ray3f, si.spawn_ray(ray.d), mi.UInt32(going))
        return np.where(weight > 0.02, seen / np.maximum(weight, 0.02), np.nan).astype(np.float32)

    def _sky(self, si: Hit) -> Floats:
        """Visible fraction of an even sky above each surface, on the side that is seen."""
        facing = dr.abs(si.wi.z)
        normal = dr.select(si.wi.z < 0, -si.n, si.n)
        frame = mi.Frame3f(normal)
        first = SKY_RAYS * dr.arange(mi.UInt32, dr.width(si))
        free = mi.Float(0)
        for number in range(SKY_RAYS):
            point = mi.Point2f(*(mi.Float((first + number) * step) / 2**32 for step in PLASTIC))
            towards = mi.warp.square_to_cosine_hemisphere(point)
            ray = si.spawn_ray(frame.to_world(towards))
            ray.maxt = SKY_MAX_RANGE_M
            free += dr.select(self.meshes.scene.ray_test(ray, si.is_valid()), 0, 1 / SKY_RAYS)
        shade: Float = (0.25 + 0.75 * free) * (0.55 + 0.45 * facing)
        return np.asarray(shade.numpy(), dtype=np.float64)


def _is_pane(thing: SceneObject) -> bool:
    return is_null_transmitting(thing.material)
