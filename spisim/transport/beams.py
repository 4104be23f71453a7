"""Laser pencils: ends whose paths all begin on a line.

No path from a detector ever meets a pencil by chance. Detector-side paths are therefore connected
to a point chosen *along the beam*: the surface it hits, or a point in the fog drawn
equi-angularly about the vertex that is to be connected (Kulla & Fajardo, EGSR 2012), which
cancels the 1/distance² between the two.

The beam's first vertex x₁ plays the part of a point source whose lobe is the scattering at x₁;
`walk` then numbers vertices from x₂ on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.transport.ends import Connection, Detectors, Launch
from spisim.transport.fog import Fog
from spisim.transport.views import BeamView


class _State(NamedTuple):
    rate: Any  # κ x (density of x₁ along the beam) x (density of the direction leaving it)
    in_fog: Any
    distance: Any
    lane: Any


@dataclass(frozen=True, eq=False)
class Beams:
    """Laser pencils through a scene and its fog; rows of the accumulator are beams."""

    scene: Any
    fog: Fog
    origins: Any
    directions: Any
    count: int
    samples: int

    @classmethod
    def of(cls, scene: Any, fog: Fog, view: BeamView, samples: int) -> Beams:
        """`samples` paths per beam and launch."""
        origins = mi.Point3f(view.origins_m.T.astype(np.float32))
        directions = mi.Vector3f(view.directions.T.astype(np.float32))
        dr.make_opaque(origins, directions)
        return cls(scene, fog, origins, directions, len(view.origins_m), samples)

    @property
    def lanes(self) -> int:
        return self.count * self.samples

    def cell(self, lane: Any) -> Any:
        return lane % self.count

    def launch(self, lane: Any, sampler: Any) -> Launch:
        ray, si, reach = self._beam(lane)
        distance = self.fog.sample_distance(sampler.next_1d())
        in_fog = distance < reach
        distance = dr.select(in_fog, distance, reach)
        on_surface = ~in_fog & si.is_valid()
        point = ray(distance)

        choice, square = sampler.next_1d(), sampler.next_2d()
        mei = self.fog.interaction(point, ray.d)
        scattered, phase_weight, phase_density = self.fog.phase.sample(
            mi.PhaseFunctionContext(), mei, choice, square, in_fog
        )
        bsdf = si.bsdf()
        sample, bsdf_weight = bsdf.sample(mi.BSDFContext(), si, choice, square, on_surface)
        outgoing = si.spawn_ray(si.to_world(sample.wo))

        weight = dr.select(in_fog, self.fog.albedo * phase_weight.x, bsdf_weight.x)
        weight = dr.select(in_fog | on_surface, weight, 0)
        specular = on_surface & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        density = dr.select(in_fog, phase_density, dr.select(specular, dr.inf, sample.pdf))
        rate = self.samples * self._arrival(in_fog, distance) * density
        return Launch(
            dr.select(in_fog, point, outgoing.o),
            dr.select(in_fog, scattered, outgoing.d),
            weight / self.samples,
            distance,
            _State(rate, in_fog, distance, lane),
            self.cell(lane),
        )

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        ray, si, reach = self._beam(launch.state.lane)
        angular = _EquiAngular.about(first_vertex, ray, reach)
        fog_share = self._fog_share(si)
        chosen = dr.select(
            launch.state.in_fog, fog_share * angular.density(launch.state.distance), 1 - fog_share
        )
        return launch.state.rate / chosen

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        ray, si, reach = self._beam(lane)
        fog_share = self._fog_share(si)
        in_fog = sampler.next_1d() < fog_share
        angular = _EquiAngular.about(vertex, ray, reach)
        distance = dr.select(in_fog, angular.sample(sampler.next_1d()), reach)
        chosen = dr.select(in_fog, fog_share * angular.density(distance), 1 - fog_share)
        point = ray(distance)
        leaving = dr.normalize(vertex - point)

        mei = self.fog.interaction(point, ray.d)
        phase, _ = self.fog.phase.eval_pdf(mi.PhaseFunctionContext(), mei, leaving, in_fog)
        on_surface = ~in_fog & si.is_valid()
        bsdf = si.bsdf()
        reflected, density = bsdf.eval_pdf(mi.BSDFContext(), si, si.to_local(leaving), on_surface)
        lobe = dr.select(in_fog, self.fog.albedo * phase.x, reflected.x)
        density = dr.select(in_fog, phase.x, density)
        arrival = self._arrival(in_fog, distance) / chosen
        return Connection(
            point, arrival * lobe, self.samples * arrival * density, distance, self.cell(lane)
        )

    def _beam(self, lane: Any) -> tuple[Any, Any, Any]:
        """The beam's ray, the surface it hits, and how far it stays in the scene or the fog."""
        cell = self.cell(lane)
        ray = mi.Ray3f(
            dr.gather(mi.Point3f, self.origins, cell),
            dr.gather(mi.Vector3f, self.directions, cell),
        )
        si = self.scene.ray_intersect(ray)
        reach = dr.select(si.is_valid(), si.t, self.fog.exit_distance(ray.o, ray.d))
        return ray, si, reach

    def _arrival(self, in_fog: Any, distance: Any) -> Any:
        """Density of x₁ in free flight: per metre in fog, a probability on the surface."""
        through = self.fog.transmittance(distance)
        return dr.select(in_fog, self.fog.extinction_per_m * through, through)

    def _fog_share(self, si: Any) -> Any:
        """How often a detector-side path is connected to the fog rather than the surface."""
        return dr.select(self.fog.extinction_per_m > 0, dr.select(si.is_valid(), 0.5, 1), 0)


class _EquiAngular(NamedTuple):
    """Distances along a ray, uniform in the angle under which a point sees them."""

    foot: Any  # distance of the point's foot on the ray
    height: Any  # of the point above the ray
    low: Any
    high: Any

    @classmethod
    def about(cls, point: Any, ray: Any, far: Any, near: Any = 0.0) -> _EquiAngular:
        offset = point - ray.o
        foot = dr.dot(offset, ray.d)
        height = dr.maximum(dr.norm(offset - foot * ray.d), 1e-6)
        return cls(foot, height, dr.atan2(near - foot, height), dr.atan2(far - foot, height))

    def sample(self, u: Any) -> Any:
        return self.foot + self.height * dr.tan(dr.lerp(self.low, self.high, u))

    def density(self, distance: Any) -> Any:
        span = (self.high - self.low) * (self.height**2 + dr.square(distance - self.foot))
        return self.height / span


class _FreeFlight(NamedTuple):
    """Distances along a ray with density ∝ exp(-σ t) between `near` and `far`."""

    extinction_per_m: Any
    near: Any
    far: Any

    def sample(self, u: Any) -> Any:
        flight = -dr.log(1 - u * self._fraction()) / self.extinction_per_m
        return dr.minimum(self.near + flight, self.far)

    def density(self, distance: Any) -> Any:
        sigma = self.extinction_per_m
        return sigma * dr.exp(-sigma * (distance - self.near)) / self._fraction()

    def _fraction(self) -> Any:
        return 1 - dr.exp(-self.extinction_per_m * (self.far - self.near))


def direct_light(
    beams: Beams,
    detectors: Detectors,
    lane: Any,
    sampler: Any,
    deposit: Callable[[Any, Any, Any, Any, Any], None],
) -> None:
    """Light scattered once: at the surface the beam hits, and along its way through the fog.

    One fog point per lane, on the part of the beam that the detector's field covers: equi-angular
    about the detector, which is right near the instrument, or in free flight, which is right far
    away.
    """
    fog, scene = beams.fog, beams.scene
    ray, si, reach = beams._beam(lane)

    end = detectors.connect(lane, si.p, sampler)
    towards, gap = _towards(si.p, end.point)
    reflected = si.bsdf().eval(mi.BSDFContext(), si, si.to_local(towards), si.is_valid())
    value = reflected.x * fog.transmittance(reach + gap) * end.importance / (gap * gap)
    lit = (value > 0) & si.is_valid()
    lit &= ~scene.ray_test(si.spawn_ray_to(end.point), lit)
    deposit(value / beams.samples, beams.cell(lane), reach + gap, mi.UInt32(1), lit)

    near, far = detectors.overlap(lane, ray, reach)
    angular = _EquiAngular.about(end.point, ray, far, near)
    flight = _FreeFlight(fog.extinction_per_m, near, far)
    choice = sampler.next_1d()
    distance = dr.select(sampler.next_1d() < 0.5, angular.sample(choice), flight.sample(choice))
    density = 0.5 * (angular.density(distance) + flight.density(distance))
    point = ray(distance)
    end = detectors.connect(lane, point, sampler)
    towards, gap = _towards(point, end.point)
    mei = fog.interaction(point, ray.d)
    phase, _ = fog.phase.eval_pdf(mi.PhaseFunctionContext(), mei, towards)
    value = fog.albedo * fog.extinction_per_m * phase.x * fog.transmittance(distance + gap)
    value *= end.importance / (gap * gap * density)
    lit = (value > 0) & (far > near)
    segment = mi.Ray3f(point, towards)
    segment.maxt = gap * (1 - mi.math.ShadowEpsilon)
    lit &= ~scene.ray_test(segment, lit)
    deposit(value / beams.samples, beams.cell(lane), distance + gap, mi.UInt32(1), lit)


def _towards(start: Any, stop: Any) -> tuple[Any, Any]:
    offset = stop - start
    gap = dr.norm(offset)
    return offset / gap, gap
