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
from spisim.transport.mirrors import Fold, reflected
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
    ) -> Float:
        """Fraction of light that gets from a vertex, `si` or a `point` in fog, to the end."""
        clear = self.world.geometry.transmission(si, point, towards, gap_m, in_fog, active)
        return clear * self.world.media.transmittance(
            mi.Ray3f(point, towards), gap_m, sampler, active
        )


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
    ) -> Float:
        """Fraction of light that gets from a vertex to the end, reflected by the planes."""
        ray = si.spawn_ray(towards)
        ray.o = dr.select(in_fog, point, ray.o)
        geometry, media = self.world.geometry, self.world.media
        return reflected(geometry, media, self.fold, ray, gap_m, sampler, active)

    def _image(self, end: Connection) -> Connection:
        importance = end.importance / self.fold.probability
        return end._replace(point=self.fold.image(end.point), importance=importance)
