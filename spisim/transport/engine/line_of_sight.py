"""How the vertices of a path see an end: straight, through panes, or in plane mirrors.

In each case a vertex is connected to a point at the length of the path to it; only the fraction of
light that arrives differs.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.ends import Connection
from spisim.transport.engine.lights import Lamp
from spisim.transport.jit import Bool, Float, Hit, Point, Ray, Sampler, UInt, Vector
from spisim.transport.mirrors import Fold
from spisim.transport.scores import Scored
from spisim.transport.world import World


@dataclass(frozen=True, eq=False)
class Straight:
    """An end at its own position."""

    world: World
    end: Detectors | Lamp

    def connect_to(self, number: UInt, vertex: Point, sampler: Sampler) -> Connection:
        end: Connection = self.end.connect_to(number, vertex, sampler)
        return end

    def overlap(self, number: UInt, ray: Ray, far: Float) -> tuple[Float, Float]:
        near, far = self.end.overlap(number, ray, far)
        return near, far

    def transmission(
        self,
        si: Hit,
        point: Point,
        towards: Vector,
        gap_m: Float,
        in_fog: Bool,
        sampler: Sampler,
        active: Bool,
    ) -> Scored:
        """Fraction of light that gets from a vertex, `si` or a `point` in fog, to the end."""
        clear = self.world.geometry.transmission(si, point, towards, gap_m, in_fog, active)
        ray = mi.Ray3f(point, towards)
        return self.world.transmittance(ray, gap_m, sampler, active) * clear


@dataclass(frozen=True, eq=False)
class Mirrored:
    """The image of an end behind the planes of a fold (the method of images)."""

    world: World
    end: Detectors | Lamp
    fold: Fold

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        return self._image(self.end.connect(lane, self.fold.image_of_vertex(vertex), sampler))

    def connect_to(self, number: UInt, vertex: Point, sampler: Sampler) -> Connection:
        return self._image(self.end.connect_to(number, self.fold.image_of_vertex(vertex), sampler))

    def overlap(self, number: UInt, ray: Ray, far: Float) -> tuple[Float, Float]:
        near, far = self.end.overlap(number, self.fold.ray_of_vertex(ray), far)
        return near, far

    def transmission(
        self,
        si: Hit,
        point: Point,
        towards: Vector,
        gap_m: Float,
        in_fog: Bool,
        sampler: Sampler,
        active: Bool,
    ) -> Scored:
        """Fraction of light that gets from a vertex to the end, reflected by the planes."""
        ray = si.spawn_ray(towards)
        ray.o = dr.select(in_fog, point, ray.o)
        return reflected(self.world, self.fold, ray, gap_m, sampler, active)

    def _image(self, end: Connection) -> Connection:
        importance = end.importance / self.fold.probability
        return end._replace(point=self.fold.image(end.point), importance=importance)


def reflected(
    world: World, fold: Fold, ray: Ray, far: Float, sampler: Sampler, lit: Bool
) -> Scored:
    """Fraction of light that a fold reflects along a ray to an end, `far` in unfolded length."""
    geometry, context = world.geometry, mi.BSDFContext(mi.TransportMode.Importance)
    light, rest_m = Scored(dr.select(lit, mi.Float(1), 0)), mi.Float(far)
    for number, plane in enumerate(fold.planes):
        here = (light.value > 0) & (number < fold.met)
        before, passed_m, through = ray, mi.Float(0), mi.Float(1)
        if geometry.see_through:
            before, passed_m, through = geometry.up_to(plane.holds, ray, here)
        si = geometry.scene.ray_intersect(before, here)
        gap_m = passed_m + si.t
        met = here & si.is_valid() & (gap_m < rest_m) & plane.holds(si) & (through > 0)
        # The first choice of every mirror, pane and coat is to reflect.
        sample, weight = si.bsdf().sample(context, si, mi.Float(0), mi.Point2f(0.5), met)
        met &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
        turn = Scored(
            weight.x * sample.pdf * through, world.tracked.sampled(context, si, sample, met)
        )
        turn *= world.transmittance(ray, gap_m, sampler, met)
        light *= Scored(dr.select(met, turn.value, 0), turn.scores).within(here)
        rest_m -= dr.select(met, gap_m, 0)
        ray = dr.select(met, si.spawn_ray(si.to_world(sample.wo)), ray)
    light *= geometry.along(ray, rest_m, light.value > 0)
    return light * world.transmittance(ray, rest_m, sampler, light.value > 0)
