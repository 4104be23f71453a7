"""Media within closed meshes, which need not be convex and are invisible to light.

A ray crosses such a mesh inwards and outwards in turn. Whether it starts inside need not be known:
its length inside up to a distance d is the integral of the winding number, Σ s_k min(t_k, d) over
all crossings beyond the start, with s = 1 for crossings outwards and -1 for crossings inwards. The
winding number at the start is Σ s_k. Where a mesh overlaps itself, its medium counts as often as
the mesh wraps around the point.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from spisim.transport.crossings import NONE, ClosedMesh
from spisim.transport.jit import Bool, Float, Object, Point, Ray, Sampler
from spisim.transport.media import Grid

#: Direction in which a point's winding number is counted: along no edge or plane of usual models.
SLANTED = (0.36235775, 0.47384721, 0.80258311)


@dataclass(frozen=True, eq=False)
class Enclosed:
    """A medium within a closed mesh: homogeneous, or with the density of a grid around the mesh."""

    surface: ClosedMesh
    extinction_per_m: Float
    albedo: Float
    phase: Object
    grid: Grid | None = None

    @property
    def in_closed_form(self) -> bool:
        return self.grid is None

    @dr.syntax
    def flight(self, ray: Ray, far: Float, sampler: Sampler, active: Bool, left_m: Float) -> Float:
        """Drawn afresh between crossings, because flights have no memory; without a bias."""
        wraps, inside_m = self.surface.sums(ray, far, active)
        result, gone, since = mi.Float(dr.inf), mi.Float(0), mi.Float(0)
        last = mi.UInt32(NONE)
        going = active & (inside_m > 0)
        while dr.hint(going, exclude=[self, ray, far]):
            crossing = self.surface.next(ray, gone, last, going)
            end = dr.minimum(crossing.distance, far)
            inside = going & (wraps > 0.5)
            distance = self._collision(ray, since, end, wraps, sampler, inside)
            result = dr.select(inside & (distance < end), distance, result)
            wraps -= dr.select(crossing.met, crossing.sign, 0)
            since = dr.select(going, end, since)
            gone, last = crossing.beyond, crossing.triangle
            going &= crossing.met & (crossing.distance < far) & (result == dr.inf)
        return result

    def transmittance(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        if self.grid is None:
            return dr.exp(-self.depth(ray, far, sampler, active))
        return self._tracked(ray, far, sampler, active)

    def depth(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        if self.grid is None:
            _, inside_m = self.surface.sums(ray, far, active)
            return self.extinction_per_m * inside_m
        near, end = self.grid.box.interval(ray, far)
        position = ray(dr.lerp(near, end, sampler.next_1d(active)))
        return dr.select(near < end, self.extinction_at(position) * (end - near), 0)

    def extinction_at(self, point: Point) -> Float:
        slanted = mi.Ray3f(mi.Point3f(point), mi.Vector3f(*SLANTED))
        wraps, _ = self.surface.sums(slanted, mi.Float(0), mi.Bool(True))
        density = mi.Float(1) if self.grid is None else self.grid.density_at(point)
        return self.extinction_per_m * dr.maximum(wraps, 0) * density

    @dr.syntax
    def _tracked(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        """Ratio tracking, from crossing to crossing."""
        assert self.grid is not None
        wraps, inside_m = self.surface.sums(ray, far, active)
        through, gone, since = mi.Float(1), mi.Float(0), mi.Float(0)
        last = mi.UInt32(NONE)
        going = active & (inside_m > 0)
        while dr.hint(going, exclude=[self, ray, far]):
            crossing = self.surface.next(ray, gone, last, going)
            end = dr.minimum(crossing.distance, far)
            inside = going & (wraps > 0.5)
            through *= self.grid.tracked(ray, since, end, wraps, sampler, inside)
            wraps -= dr.select(crossing.met, crossing.sign, 0)
            since = dr.select(going, end, since)
            gone, last = crossing.beyond, crossing.triangle
            going &= crossing.met & (crossing.distance < far) & (through > 0)
        return through

    def _collision(
        self, ray: Ray, near: Float, end: Float, times: Float, sampler: Sampler, active: Bool
    ) -> Float:
        """First collision on the stretch between two crossings."""
        if self.grid is not None:
            return self.grid.collision(ray, near, end, times, sampler, active)
        rate = self.extinction_per_m * times
        return near - dr.log(1 - sampler.next_1d(active)) / rate
