"""The third strategy: a detector's walk, connected to a point of a ray from the projector.

It finds both a first vertex close to the projector, which lies on the projector's ray, and a last
vertex close to the detector, which lies on the walk. Points on the ray are drawn equi-angularly
about the vertex to be connected, which cancels the 1/d² between them.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.ends import Connection, Projector
from spisim.transport.engine.lights import Lamp
from spisim.transport.geometry import EquiAngular, direction_to
from spisim.transport.jit import Bool, Float, Point, Ray, Sampler
from spisim.transport.scores import together
from spisim.transport.world import World


@dataclass(frozen=True, eq=False)
class FogRays:
    """Rays through random points of the projector's field."""

    world: World
    projector: Projector | Lamp

    def connect(self, vertex: Point, sampler: Sampler, active: Bool) -> tuple[Connection, Float]:
        """A point in fog on a random ray, and the `density` with which it is picked."""
        media = self.world.media
        ray, weight, launched, cell = self.projector.random_ray(sampler)
        density = self.projector.random_ray_density(ray.d, ray.o)
        angular = EquiAngular.about(vertex, ray, mi.Float(dr.inf))
        distance = angular.sample(sampler.next_1d())
        point = mi.Point3f(ray(distance))
        extinction = media.extinction_at(point)
        medium = media.pick(point, sampler.next_1d())
        towards, gap = direction_to(point, vertex)
        inside = active & (extinction > 0)
        phase = media.phase(medium, point, ray.d, towards, inside)
        clear = self.world.geometry.between(point, -ray.d, distance, inside & (phase > 0))
        through = self.world.transmittance(ray, distance, sampler, clear > 0)
        given = media.closed_form_transmittance(ray, distance)
        biased = media.flight_density(ray, distance, medium, inside, mi.Float(0))
        picked = angular.density(distance)
        strength = (
            clear * through.value * media.albedo(medium) * extinction * phase / (picked * gap * gap)
        )
        end = Connection(
            point=point,
            importance=dr.select(inside, weight * strength, 0),
            density=launched * given * biased * extinction * phase / (picked * gap * gap),
            length_m=distance,
            scatterings=mi.UInt32(1),
            cell=cell,
            scores=together(
                through.scores, self.world.tracked.scattered_by(medium, ray.d, towards, inside)
            ),
        )
        return end, density * picked / (distance * distance * extinction)

    def density(self, ray: Ray, distance: Float, second: Point) -> Float:
        """Number density with which `connect` picks the point `distance` along a ray.

        Seen from `second`, over that of a free flight's collision there, times distance²; 0 where
        no such ray exists.
        """
        angular = EquiAngular.about(second, ray, mi.Float(dr.inf))
        towards = self.projector.random_ray_density(ray.d, ray.o)
        extinction = self.world.media.extinction_at(ray(distance))
        density = towards * angular.density(distance) / extinction
        return dr.select(extinction > 0, density, 0)
