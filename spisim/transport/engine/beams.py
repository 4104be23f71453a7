"""Laser pencils: ends whose paths all begin on a line.

No path from a detector meets a pencil by chance. Such a path is therefore connected to a point
chosen *along the beam*: the surface that the beam hits, or a point in the fog. The fog point is
drawn equi-angularly about the vertex to be connected (Kulla & Fajardo, EGSR 2012), which cancels
the 1/distance² between the two.

The first vertex x₁ on the beam acts as a point source whose lobe is the scattering at x₁, so `walk`
numbers vertices from x₂ on. A pane that a pencil passes straight through acts the same way,
although it is no vertex: no path from a detector is connected to what lies behind it.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.instrument.views import BeamView
from spisim.transport.engine.ends import Connection, Launch
from spisim.transport.geometry import EquiAngular
from spisim.transport.jit import Bool, Float, Frame, Hit, Object, Point, Ray, Sampler, UInt
from spisim.transport.scores import together
from spisim.transport.world import World


class _Beam(NamedTuple):
    """One pencil of a laser: its ray, the surface it hits, and the distance to it."""

    ray: Ray
    si: Hit
    far: Float


class _State(NamedTuple):
    beam: _Beam
    density: (
        Float  # samples x (density of x₁ along the beam) x (density of the direction leaving it)
    )
    in_fog: Bool
    distance: Float


@dataclass(frozen=True, eq=False)
class Beams:
    """Lasers in a scene and its media; rows of the accumulator are beams.

    A laser of finite width and divergence is a bundle of pencils, Gaussian in angle and position;
    each path draws one of them.
    """

    world: World
    frames: Frame  # n is the beam's axis
    origins: Point
    divergence_rad: Float  # standard deviation of the angle, per axis
    waist_m: Float  # standard deviation of the exit position, per axis
    count: int
    samples: int
    samples_jit: Float  # see `Projector`

    @classmethod
    def of(cls, world: World, view: BeamView, samples: int) -> Self:
        """Convert a view; `samples` paths per beam and launch."""
        origins = mi.Point3f(view.origins_m.T.astype(np.float32))
        frames = mi.Frame3f(mi.Vector3f(view.directions.T.astype(np.float32)))
        dr.make_opaque(origins, frames)
        return cls(
            world=world,
            frames=frames,
            origins=origins,
            divergence_rad=dr.opaque(mi.Float, view.divergence_rad),
            waist_m=dr.opaque(mi.Float, view.waist_m),
            count=len(view.origins_m),
            samples=samples,
            samples_jit=dr.opaque(mi.Float, samples),
        )

    def times(self, factor: int) -> Self:
        """The same beams with `factor` times the paths."""
        return replace(self, samples=factor * self.samples, samples_jit=factor * self.samples_jit)

    @property
    def lanes(self) -> int:
        return self.count * self.samples

    def cell(self, lane: UInt) -> UInt:
        return lane % self.count

    def launch(self, lane: UInt, sampler: Sampler) -> Launch:
        beam = self._beam(lane, sampler)
        ray, si, far = beam
        collision = self.world.media.flight(ray, far, sampler, mi.Bool(True))
        in_fog = collision.distance < far
        distance = dr.select(in_fog, collision.distance, far)
        on_surface = ~in_fog & si.is_valid()
        point = ray(distance)

        choice, square = sampler.next_1d(), sampler.next_2d()
        scattered, phase_weight, phase_density = self.world.media.scatter(
            collision.medium, point, ray.d, choice, square, in_fog
        )
        bsdf = si.bsdf()
        sample, bsdf_weight = bsdf.sample(_context(), si, choice, square, on_surface)
        outgoing = si.spawn_ray(si.to_world(sample.wo))

        weight = dr.select(in_fog, self.world.media.albedo(collision.medium) * phase_weight, 0)
        weight = dr.select(on_surface, bsdf_weight.x, weight)
        specular = on_surface & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        straight = on_surface & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Null)
        density = dr.select(in_fog, phase_density, dr.select(specular, dr.inf, sample.pdf))
        tracked = self.world.tracked
        scores = together(
            tracked.along(ray, distance, sampler, mi.Bool(True)),
            tracked.scattered_by(collision.medium, ray.d, scattered, in_fog),
            tracked.sampled(_context(), si, sample, on_surface),
        )
        return Launch(
            origin=dr.select(in_fog, point, outgoing.o),
            direction=dr.select(in_fog, scattered, outgoing.d),
            beta=weight / self.samples_jit,
            length_m=distance,
            scatterings=dr.select(in_fog, mi.UInt32(1), mi.UInt32(0)),
            state=_State(
                beam,
                self.samples_jit * self._arrival(ray, point, distance, in_fog) * density,
                in_fog,
                distance,
            ),
            cell=self.cell(lane),
            crossings=dr.select(straight, mi.UInt32(1), mi.UInt32(0)),
            scores=scores,
        )

    def density(self, launch: Launch, first_vertex: Point) -> Float:
        state = launch.state
        ray, si, far = state.beam
        angular = EquiAngular.about(first_vertex, ray, far)
        fog_fraction = self._fog_fraction(si)
        chosen = dr.select(
            state.in_fog, fog_fraction * angular.density(state.distance), 1 - fog_fraction
        )
        return state.density / chosen

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        ray, si, far = self._beam(lane, sampler)
        fog_fraction = self._fog_fraction(si)
        in_fog = sampler.next_1d() < fog_fraction
        angular = EquiAngular.about(vertex, ray, far)
        distance = dr.select(in_fog, angular.sample(sampler.next_1d()), far)
        chosen = dr.select(in_fog, fog_fraction * angular.density(distance), 1 - fog_fraction)
        point = ray(distance)
        towards = mi.Vector3f(vertex - point)
        squared = dr.squared_norm(towards)
        leaving = towards * dr.rsqrt(squared)

        medium = self.world.media.pick(point, sampler.next_1d())
        phase = self.world.media.phase(medium, point, ray.d, leaving, in_fog)
        on_surface = ~in_fog & si.is_valid()
        local = si.to_local(leaving)
        reflected, density = si.bsdf().eval_pdf(_context(), si, local, on_surface)
        lobe = dr.select(in_fog, self.world.media.albedo(medium) * phase, reflected.x)
        density = dr.select(in_fog, phase, density)
        seen = dr.rcp(squared * chosen)
        through = self.world.transmittance(ray, distance, sampler, mi.Bool(True))
        strength = dr.select(in_fog, self.world.media.extinction_at(point), 1)
        return Connection(
            point=point,
            importance=seen * strength * through.value * lobe,
            density=self.samples_jit * seen * density * self._arrival(ray, point, distance, in_fog),
            length_m=distance,
            scatterings=dr.select(in_fog, mi.UInt32(1), mi.UInt32(0)),
            cell=self.cell(lane),
            scores=together(
                through.scores,
                self.world.tracked.scattered_by(medium, ray.d, leaving, in_fog),
                self.world.tracked.reflected(_context(), si, local, reflected.x, on_surface),
            ),
        )

    def pencil(self, lane: UInt, sampler: Sampler) -> tuple[Ray, Float]:
        """One pencil of the lane's laser, as a ray, and its weight."""
        return self._pencil(lane, sampler), dr.rcp(self.samples_jit)

    def _pencil(self, lane: UInt, sampler: Sampler) -> Ray:
        cell = self.cell(lane)
        frame = dr.gather(mi.Frame3f, self.frames, cell)
        tilt = mi.warp.square_to_std_normal(sampler.next_2d()) * self.divergence_rad
        shift = mi.warp.square_to_std_normal(sampler.next_2d()) * self.waist_m
        origin = dr.gather(mi.Point3f, self.origins, cell)
        return mi.Ray3f(
            mi.Point3f(origin + frame.s * shift.x + frame.t * shift.y),
            frame.to_world(dr.normalize(mi.Vector3f(tilt.x, tilt.y, 1))),
        )

    def _beam(self, lane: UInt, sampler: Sampler) -> _Beam:
        ray = self._pencil(lane, sampler)
        return _Beam(ray, *self.world.first_surface(ray))

    def _arrival(self, ray: Ray, point: Point, distance: Float, in_fog: Bool) -> Float:
        """Closed-form factors of x₁'s density in flight: per metre in fog, else a probability."""
        through = self.world.media.closed_form_transmittance(ray, distance)
        return dr.select(in_fog, self.world.media.extinction_at(point) * through, through)

    def _fog_fraction(self, si: Hit) -> Float:
        """Probability of connecting a detector's path to the fog rather than to the surface."""
        if not self.world.media.parts:
            return mi.Float(0)
        return dr.select(si.is_valid(), 0.5, 1)


def _context() -> Object:
    return mi.BSDFContext(mi.TransportMode.Importance)
