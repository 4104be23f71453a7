"""A vertex of a path, on a surface or in fog."""

from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.geometry import Geometry
from spisim.transport.jit import Bool, Float, Hit, Object, Point, Point2, Ray, Sampler, UInt, Vector
from spisim.transport.media import Media


class Lobe(NamedTuple):
    """Scattering at a vertex from one direction into another."""

    value: Float  # BSDF x cosine, or phase function, 1/sr
    forward: Float  # density with which the walk would choose this direction, 1/sr
    backward: Float  # density of the way back, had the walk come from there, 1/sr
    cosines: Float  # |outgoing| / |incoming| cosine, 1 in fog


class Turn(NamedTuple):
    """A direction drawn by the walk."""

    ray: Ray  # leaves the vertex
    weight: Float  # value / density
    forward: Float
    backward: Float
    cosines: Float
    straight: Bool  # passed straight through a surface: no turn at all
    specular: Bool  # mirrored or refracted: densities are deltas


class Vertex(NamedTuple):
    """A surface interaction, or a point in a medium, reached along `incoming`."""

    geometry: Geometry
    media: Media
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
        phase = self.media.phase(
            self.medium, self.point, self.incoming, towards, self.in_fog & active
        )
        reflected, density = bsdf.eval_pdf(self.context, self.si, local, self.on_surface & active)
        return Lobe(
            value=dr.select(self.in_fog, phase, reflected.x),
            forward=dr.select(self.in_fog, phase, density),
            backward=dr.select(self.in_fog, phase, self._backward(local, self.on_surface & active)),
            cosines=self._cosines(local),
        )

    def turn(self, choice: Float, square: Point2) -> Turn:
        """Draw a new direction."""
        scattered, phase_weight, phase_density = self.media.scatter(
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
        return Turn(
            ray=ray,
            weight=dr.select(self.in_fog, phase_weight, weight.x),
            forward=dr.select(self.in_fog, phase_density, sample.pdf),
            backward=dr.select(self.in_fog, phase_density, self._backward(sample.wo, rough)),
            cosines=self._cosines(sample.wo),
            straight=straight,
            specular=specular & ~straight,
        )

    def transmission(self, towards: Vector, gap: Float, sampler: Sampler, active: Bool) -> Float:
        """Fraction of light that gets `gap` away, past surfaces and through media."""
        clear = self.geometry.transmission(self.si, self.point, towards, gap, self.in_fog, active)
        through = self.media.transmittance(
            mi.Ray3f(self.point, towards), gap, sampler, active & (clear > 0)
        )
        return clear * through

    def _backward(self, local: Vector, active: Bool) -> Float:
        mirrored = mi.SurfaceInteraction3f(self.si)
        mirrored.wi = local
        return self.si.bsdf().pdf(self.context, mirrored, self.si.wi, active)

    def _cosines(self, local: Vector) -> Float:
        ratio = dr.abs(local.z) / dr.maximum(dr.abs(self.si.wi.z), 1e-7)
        return dr.select(self.in_fog, 1, ratio)
