"""Light scattered once: by the surface that a ray of light meets, and along its way through fog.

Nothing about these paths is left to chance but the place on the ray: the transmittance to the
surface is known, and the fog is sampled where the detector looks.
"""

from __future__ import annotations

from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.ends import Detectors
from spisim.transport.engine.equiangular import EquiAngular
from spisim.transport.engine.walk import Contribution, Deposit, direction_to
from spisim.transport.world import World


class Pencils(Protocol):
    """A source of rays: one per lane, each with 1 / `samples` of a cell's power."""

    @property
    def samples(self) -> int:
        """Rays per cell."""
        ...

    def pencil(self, lane: Any, sampler: Any) -> Any:
        """The lane's ray."""
        ...

    def cell(self, lane: Any) -> Any:
        """The lane's accumulator cell."""
        ...


def direct_light(
    world: World, source: Pencils, detectors: Detectors, lane: Any, sampler: Any, deposit: Deposit
) -> None:
    """Deposit what each lane's ray sends to one of the detectors by scattering once.

    The ray is followed to the first surface, be it a pane or not.

    One fog point per lane, on the part of the ray that the detector's field covers: equi-angular
    about the detector, which is right near the instrument, or uniform, which is right far away.
    """
    media = world.media
    ray, cell = source.pencil(lane, sampler), source.cell(lane)
    si, reach = world.first_surface(ray)
    number = detectors.choose(lane, sampler)
    context = mi.BSDFContext(mi.TransportMode.Importance)

    end = detectors.connect_to(number, si.p, sampler)
    towards, gap = direction_to(si.p, end.point)
    reflected = si.bsdf().eval(context, si, si.to_local(towards), si.is_valid())
    value = reflected.x * end.importance
    lit = (value > 0) & si.is_valid()
    value *= world.geometry.transmission(si, si.p, towards, gap, mi.Bool(False), lit)
    value *= media.transmittance(ray.o, ray.d, reach, sampler, lit)
    value *= media.transmittance(si.p, towards, gap, sampler, lit)
    deposit(Contribution(value / source.samples, cell, reach + gap, mi.UInt32(0), lit))
    if not media.parts:
        return

    near, far = detectors.overlap(number, ray, reach)
    angular = EquiAngular.about(end.point, ray, far, near)
    choice = sampler.next_1d()
    distance = dr.select(
        sampler.next_1d() < 0.5, angular.sample(choice), dr.lerp(near, far, choice)
    )
    density = 0.5 * (angular.density(distance) + dr.rcp(far - near))
    point = mi.Point3f(ray(distance))
    medium = media.pick(point, sampler.next_1d())
    end = detectors.connect_to(number, point, sampler)
    towards, gap = direction_to(point, end.point)
    value = media.albedo(medium) * media.extinction_at(point) * end.importance / density
    lit = (value > 0) & (far > near)
    value *= media.phase(medium, point, ray.d, towards, lit)
    value *= world.geometry.between(point, towards, gap, lit)
    value *= media.transmittance(ray.o, ray.d, distance, sampler, lit)
    value *= media.transmittance(point, towards, gap, sampler, lit)
    deposit(Contribution(value / source.samples, cell, distance + gap, mi.UInt32(1), lit))
