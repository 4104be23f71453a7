"""The surfaces of a scene and the light that gets past them; sampling along rays."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.transport.jit import Bool, Float, Hit, Matrix, Object, Point, Ray, Vector

_ENDLESS_M = 1e12
"""Length of a ray without end; its square is finite in 32 bits."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """Surfaces, and whether any of them lets light straight through."""

    scene: Object  # mi.Scene
    see_through: bool

    def transmission(
        self, si: Hit, point: Point, towards: Vector, gap: Float, in_fog: Bool, active: Bool
    ) -> Float:
        """Fraction of light that gets `gap` away from `si`, or `point` in fog, past surfaces."""
        ray = si.spawn_ray(towards)
        ray.o = dr.select(in_fog, point, ray.o)
        return self.along(ray, gap, active)

    def between(self, point: Point, direction: Vector, gap: Float, active: Bool) -> Float:
        """The same from a point in fog."""
        return self.along(mi.Ray3f(point, direction), gap, active)

    def along(self, ray: Ray, gap: Float, active: Bool) -> Float:
        """The same for a ray."""
        ray.maxt = gap * (1 - 10 * mi.math.ShadowEpsilon)
        if self.see_through:
            return self._through_panes(ray, active)
        return dr.select(active & ~self.scene.ray_test(ray, active), 1, 0)

    @dr.syntax
    def up_to(
        self, there: Callable[[Hit], Bool], ray: Ray, active: Bool
    ) -> tuple[Ray, Float, Float]:
        """Ray beyond the panes before a surface that is `there`, its distance, the transmission."""
        through, gone_m = mi.Float(1), mi.Float(0)
        going, ray = mi.Bool(active), mi.Ray3f(ray)
        while dr.hint(going, exclude=[self, there]):
            si = self.scene.ray_intersect(ray, going)
            going &= si.is_valid() & ~there(si)
            passed = si.bsdf().eval_null_transmission(si, going)
            through *= dr.select(going, passed.x, 1)
            gone_m += dr.select(going, si.t, 0)
            ray = dr.select(going, si.spawn_ray(ray.d), ray)
            going &= through > 0
        return ray, gone_m, through

    @dr.syntax
    def _through_panes(self, ray: Ray, active: Bool) -> Float:
        through = mi.Float(1)
        going = mi.Bool(active)
        ray = mi.Ray3f(ray)
        while dr.hint(going, exclude=[self]):
            si = self.scene.ray_intersect(ray, going)
            met = going & si.is_valid()
            passed = si.bsdf().eval_null_transmission(si, met)
            through *= dr.select(met, passed.x, 1)
            rest = ray.maxt - si.t
            ray = si.spawn_ray(ray.d)
            ray.maxt = rest
            going = met & (through > 0) & (rest > 0)
        return through


def transform(matrix: NDArray[np.floating[Any]]) -> Matrix:
    """A pose (4, 4) as an opaque Mitsuba transform."""
    result = mi.Transform4f(mi.Matrix4f(matrix.astype(np.float32)))
    dr.make_opaque(result)
    return result


def rays_of(origins: Floats, directions: Floats) -> Ray:
    """Rays from origins and unit directions, (3,) or (n, 3)."""
    return mi.Ray3f(mi.Point3f(np.float32(origins.T)), mi.Vector3f(np.float32(directions.T)))


def direction_to(start: Point, stop: Point) -> tuple[Vector, Float]:
    """Unit vector and distance from one point to another."""
    offset = mi.Vector3f(stop - start)
    gap = dr.norm(offset)
    return offset * dr.rcp(gap), gap


class EquiAngular(NamedTuple):
    """Distances uniform in the angle seen from a point (Kulla & Fajardo, EGSR 2012).

    From beside a ray nearly all of it lies at right angles, where 32 bits of an angle leave 1e-4 of
    its tangent and a GPU's fast cosine less. So an angle is kept as its cosine and sine, and a
    sample is a turn of at most 90° from the nearer end.
    """

    foot: Float  # distance along the ray to the foot of the point
    height: Float  # of the point above the ray
    near: Vector  # cosine and sine of the angle between height and near end
    far: Vector
    span: Float  # angle between the ends

    @classmethod
    def about(cls, point: Point, ray: Ray, far: Float, near: Float = 0.0) -> Self:
        offset = point - ray.o
        foot = dr.dot(offset, ray.d)
        height = dr.maximum(dr.norm(offset - foot * ray.d), 1e-6)
        far = dr.minimum(far, _ENDLESS_M)
        first, last = mi.Vector2f(height, near - foot), mi.Vector2f(height, far - foot)
        span = dr.atan2(height * (far - near), dr.dot(first, last))
        return cls(foot, height, dr.normalize(first), dr.normalize(last), span)

    def sample(self, u: Float) -> Float:
        from_near = u < 0.5
        sine, cosine = _sine_and_cosine(self.span * dr.select(from_near, u, 1 - u))
        end, turn = (dr.select(from_near, *each) for each in ((self.near, self.far), (sine, -sine)))
        tangent = (end.y * cosine + end.x * turn) / (end.x * cosine - end.y * turn)
        return self.foot + self.height * tangent

    def density(self, distance: Float) -> Float:
        return self.height / (self.span * (self.height**2 + dr.square(distance - self.foot)))


def _sine_and_cosine(angle: Float) -> tuple[Float, Float]:
    """Of up to 90°, from their series: sines of small angles are as precise as the angles."""
    square = dr.square(angle)
    sine, cosine = mi.Float(1), mi.Float(1)
    for order in range(12, 0, -2):
        cosine = dr.fma(square * (-1 / (order * (order - 1))), cosine, 1)
        sine = dr.fma(square * (-1 / (order * (order + 1))), sine, 1)
    return angle * sine, cosine
