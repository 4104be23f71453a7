"""Light scattered once: by the surface that a ray of light meets, and along its way through fog.

Nothing about these paths is left to chance but the place on the ray: the transmittance to the
surface is known, and the fog is sampled where the detector looks.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.beams import Beams
from spisim.transport.engine.ends import Detectors, Projector
from spisim.transport.engine.equiangular import EquiAngular
from spisim.transport.engine.points import Points
from spisim.transport.engine.tally import Contribution, Deposit, carries_light
from spisim.transport.geometry import direction_to
from spisim.transport.world import World


class _Pencil(NamedTuple):
    """A ray, the surface it meets, how far it goes, and the detector that looks at it."""

    ray: Any
    si: Any
    reach: Any
    detector: Any  # its number


def direct_light(
    world: World,
    source: Projector | Beams,
    detectors: Detectors,
    seed: int,
    deposit: Deposit,
    *,
    replicas: int = 1,
) -> None:
    """Deposit what each lane's ray sends to one of the detectors by scattering once.

    The ray is followed to the first surface, be it a pane or not.
    """
    lane, cell, replica, sampler = _low_discrepancy(source, replicas, seed)
    ray = source.pencil(lane, sampler)
    si, reach = world.first_surface(ray)
    pencil = _Pencil(ray, si, reach, detectors.choose(lane, sampler))

    def add(value: Any, length_m: Any, scatterings: int, lit: Any) -> None:
        light = value / source.samples
        deposit(Contribution(light, cell, length_m, mi.UInt32(scatterings), lit, replica))

    aperture_point = _off_surface(world, pencil, detectors, sampler, add)
    if world.media.parts:
        _off_fog(world, pencil, detectors, aperture_point, sampler, add)


def _off_surface(
    world: World, pencil: _Pencil, detectors: Detectors, sampler: Any, add: Any
) -> Any:
    """Light that the surface scatters; returns the place on the aperture that it goes to."""
    ray, si, reach, detector = pencil
    end = detectors.connect_to(detector, si.p, sampler)
    towards, gap = direction_to(si.p, end.point)
    context = mi.BSDFContext(mi.TransportMode.Importance)
    reflected = si.bsdf().eval(context, si, si.to_local(towards), si.is_valid())
    value = reflected.x * end.importance
    lit = carries_light(value) & si.is_valid()
    value *= world.geometry.transmission(si, si.p, towards, gap, mi.Bool(False), lit)
    value *= world.media.transmittance(ray.o, ray.d, reach, sampler, lit)
    value *= world.media.transmittance(si.p, towards, gap, sampler, lit)
    add(value, reach + gap, 0, lit)
    return end.point


def _off_fog(
    world: World,
    pencil: _Pencil,
    detectors: Detectors,
    aperture_point: Any,
    sampler: Any,
    add: Any,
) -> None:
    """Light that the fog scatters, at one point per lane where the detector's field covers the ray.

    Equi-angular about the detector, which is right near the instrument, or uniform, which is right
    far away.
    """
    media = world.media
    ray, _, reach, detector = pencil
    near, far = detectors.overlap(detector, ray, reach)
    angular = EquiAngular.about(aperture_point, ray, far, near)
    choice = sampler.next_1d()
    distance = dr.select(
        sampler.next_1d() < 0.5, angular.sample(choice), dr.lerp(near, far, choice)
    )
    density = 0.5 * (angular.density(distance) + dr.rcp(far - near))
    point = mi.Point3f(ray(distance))
    medium = media.pick(point, sampler.next_1d())
    end = detectors.connect_to(detector, point, sampler)
    towards, gap = direction_to(point, end.point)
    value = media.albedo(medium) * media.extinction_at(point) * end.importance / density
    lit = carries_light(value) & (far > near)
    value *= media.phase(medium, point, ray.d, towards, lit)
    value *= world.geometry.between(point, towards, gap, lit)
    value *= media.transmittance(ray.o, ray.d, distance, sampler, lit)
    value *= media.transmittance(point, towards, gap, sampler, lit)
    add(value, distance + gap, 1, lit)


def _low_discrepancy(
    source: Projector | Beams, replicas: int, seed: int
) -> tuple[Any, Any, Any, Any]:
    """Lanes, their cells and replicas, and a low-discrepancy sequence for every one of these."""
    number: Any = dr.arange(mi.UInt32, replicas * source.lanes)
    lane, replica = number // replicas, number % replicas
    cell = source.cell(lane)
    cells = source.lanes // source.samples
    points = Points.of(lane // cells, cell * replicas + replica, dr.opaque(mi.UInt32, seed))
    return lane, cell, replica, points
