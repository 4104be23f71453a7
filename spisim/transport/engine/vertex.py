"""A vertex of a path, on a surface or in fog."""

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.jit import Bool, Float, Hit, Object, Point, Point2, Ray, Sampler, UInt, Vector
from spisim.transport.scores import Scored, Scores, together
from spisim.transport.world import World


class Lobe(NamedTuple):
    """Scattering at a vertex from one direction into another."""

    value: Float  # BSDF x cosine, or phase function, 1/sr
    forward: Float  # density with which the walk would choose this direction, 1/sr
    backward: Float  # density of the way back, had the walk come from there, 1/sr
    cosines: Float  # |outgoing| / |incoming| cosine, 1 in fog
    scores: Scores


class Turn(NamedTuple):
    """A direction drawn by the walk."""

    ray: Ray  # leaves the vertex
    weight: Float  # value / density
    forward: Float
    backward: Float
    cosines: Float
    straight: Bool  # passed straight through a surface: no turn at all
    specular: Bool  # mirrored or refracted: densities are deltas
    scores: Scores


class Vertex(NamedTuple):
    """A surface interaction, or a point in a medium, reached along `incoming`."""

    world: World
    context: Object
    si: Hit
    medium: UInt
    point: Point
    incoming: Vector
    in_fog: Bool
    on_surface: Bool

    def lobe(self, towards: Vector, active: Bool) -> Lobe:
        """Scattering towards a direction (unit vector)."""
        bsdf, local = self.si.bsdf(), self.si.to_local(towards)
        in_fog, on_surface = self.in_fog & active, self.on_surface & active
        phase = self.world.media.phase(self.medium, self.point, self.incoming, towards, in_fog)
        reflected, density = bsdf.eval_pdf(self.context, self.si, local, on_surface)
        tracked = self.world.tracked
        return Lobe(
            value=dr.select(self.in_fog, phase, reflected.x),
            forward=dr.select(self.in_fog, phase, density),
            backward=dr.select(self.in_fog, phase, self._backward(local, on_surface)),
            cosines=self._cosines(local),
            scores=together(
                tracked.scattered_by(self.medium, self.incoming, towards, in_fog),
                tracked.reflected(self.context, self.si, local, reflected.x, on_surface),
            ),
        )

    def turn(self, choice: Float, square: Point2) -> Turn:
        """Draw a new direction."""
        scattered, phase_weight, phase_density = self.world.media.scatter(
            self.medium, self.point, self.incoming, choice, square, self.in_fog
        )
        sample, weight = self.si.bsdf().sample(
            self.context, self.si, choice, square, self.on_surface
        )
        straight = self.on_surface & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
        specular = self.on_surface & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        rough = self.on_surface & ~straight & ~specular
        ray = self.si.spawn_ray(self.si.to_world(sample.wo))
        ray.o = dr.select(self.in_fog, self.point, ray.o)
        ray.d = dr.select(self.in_fog, scattered, ray.d)
        tracked = self.world.tracked
        return Turn(
            ray=ray,
            weight=dr.select(self.in_fog, phase_weight, weight.x),
            forward=dr.select(self.in_fog, phase_density, sample.pdf),
            backward=dr.select(self.in_fog, phase_density, self._backward(sample.wo, rough)),
            cosines=self._cosines(sample.wo),
            straight=straight,
            specular=specular & ~straight,
            scores=together(
                tracked.scattered_by(self.medium, self.incoming, scattered, self.in_fog),
                tracked.sampled(self.context, self.si, sample, self.on_surface),
            ),
        )

    def transmission(self, towards: Vector, gap: Float, sampler: Sampler, active: Bool) -> Scored:
        """Fraction of light that gets `gap` away, past surfaces and through media."""
        geometry, ray = self.world.geometry, mi.Ray3f(self.point, towards)
        clear = geometry.transmission(self.si, self.point, towards, gap, self.in_fog, active)
        return self.world.transmittance(ray, gap, sampler, active & (clear > 0)) * clear

    def _backward(self, local: Vector, active: Bool) -> Float:
        mirrored = mi.SurfaceInteraction3f(self.si)
        mirrored.wi = local
        return self.si.bsdf().pdf(self.context, mirrored, self.si.wi, active)

    def _cosines(self, local: Vector) -> Float:
        ratio = dr.abs(local.z) / dr.maximum(dr.abs(self.si.wi.z), 1e-7)
        return dr.select(self.in_fog, 1, ratio)
