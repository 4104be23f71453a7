"""Light scattered once, by the first surface on a ray or by the fog before it.

The only random choice is the point on the ray: the transmittance to the surface is evaluated, and
the fog is sampled where the other end looks.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.beams import Beams
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.lights import Lamp
from spisim.transport.engine.line_of_sight import Mirrored, Straight, reflected
from spisim.transport.engine.points import Points
from spisim.transport.engine.tally import Contribution, Deposit, carries_light
from spisim.transport.geometry import EquiAngular, direction_to
from spisim.transport.jit import Bool, Float, Hit, Object, Point, Ray, Sampler, UInt
from spisim.transport.scores import Scored
from spisim.transport.world import World

#: Ends whose rays are followed, and ends that the rays are connected to.
Source = Projector | Beams | Detectors
Sink = Detectors | Lamp
#: Lane indices, cells, replicas, and random numbers.
Lanes = tuple[UInt, UInt, UInt, Points]


#: How the ray's points see the other end.
LineOfSight = Straight | Mirrored
#: Deposits light with its path length and number of scatterings, in some lanes.
Add = Callable[[Scored, Float, int, Bool], None]


class Pencil(NamedTuple):
    """A ray, the first surface it meets, the distance to it, and the index of the other end."""

    ray: Ray
    si: Hit
    far: Float
    number: UInt


def direct_light(
    world: World, this: Source, other: Sink, seed: int, deposit: Deposit, *, replicas: int = 1
) -> None:
    """Deposit what each lane's ray sends to the other end by scattering once.

    The ray is followed to the first surface, pane or not. Follow rays from the end with the
    narrower field, so that they lie in the field of the other.
    """
    lanes = low_discrepancy(this, replicas, seed)
    _along_rays(world, this, Straight(world, other), lanes, deposit)


def direct_light_in_mirrors(
    world: World, this: Beams, other: Detectors, seed: int, deposit: Deposit, *, replicas: int = 1
) -> None:
    """Deposit what a ray scatters once and mirrors show, which no path from the other end finds."""
    if world.smooth is None:
        return
    lanes = low_discrepancy(this, replicas, seed ^ 3)  # another stream
    sampler = lanes[-1]
    fold = world.smooth.choose_any(sampler.next_1d(), sampler)
    _along_rays(world, this, Mirrored(world, other, fold), lanes, deposit)


def mirrored_light(
    world: World,
    source: Projector | Lamp,
    detectors: Sink,
    seed: int,
    deposit: Deposit,
    *,
    replicas: int = 1,
) -> None:
    """Deposit the light that plane mirrors throw from the source straight onto a detector."""
    if world.mirrors is None:
        return
    lane, cell, replica, sampler = low_discrepancy(source, replicas, seed ^ 1)  # another stream
    random: Any = mi.sample_tea_float32  # its stubs accept Python numbers alone
    turn = (mi.Float(lane) + 0.5) / source.lanes + random(replica, dr.opaque(mi.UInt32, seed))
    fold = world.mirrors.choose_any(turn - dr.floor(turn), sampler)  # stratified over all planes
    number = detectors.choose(lane, sampler)
    end = Mirrored(world, detectors, fold).connect_to(number, source.middle, sampler)
    response = end.importance * dr.squared_norm(source.middle - end.point)
    start = source.connect(lane, end.point, sampler)
    towards, length_m = direction_to(start.point, end.point)
    value = start.importance * response / source.paths
    lit = carries_light(value)
    ray = mi.Ray3f(start.point, towards)
    light = Scored(value) * reflected(world, fold, ray, length_m, sampler, lit)
    lit &= carries_light(light.value)
    cell = cell if start.cell is None else start.cell
    deposit(Contribution(light.value, cell, length_m, mi.UInt32(0), lit, replica, light.scores))


def _along_rays(
    world: World, this: Source, view: LineOfSight, lanes: Lanes, deposit: Deposit
) -> None:
    lane, cell, replica, sampler = lanes
    ray, weight = this.pencil(lane, sampler)
    pencil = Pencil(ray, *world.first_surface(ray), view.end.choose(lane, sampler))

    def add(light: Scored, length_m: Float, scatterings: int, lit: Bool) -> None:
        value, order = light.value * weight, mi.UInt32(scatterings)
        deposit(Contribution(value, cell, length_m, order, lit, replica, light.scores))

    far_point = _off_surface(world, pencil, view, sampler, add)
    if world.media.parts:
        _off_fog(world, pencil, view, far_point, sampler, add)


def _off_surface(
    world: World, pencil: Pencil, view: LineOfSight, sampler: Sampler, add: Add
) -> Point:
    """Deposit what the surface scatters; returns the point of the other end that it goes to."""
    ray, si, far, number = pencil
    end = view.connect_to(number, si.p, sampler)
    towards, gap = direction_to(si.p, end.point)
    context = surface_context(view.end)
    light = world.reflected(context, si, towards, si.is_valid()) * end.importance
    lit = carries_light(light.value) & si.is_valid()
    light *= world.transmittance(ray, far, sampler, lit)
    light *= view.transmission(si, si.p, towards, gap, mi.Bool(False), sampler, lit)
    add(light, far + gap, 0, lit)
    return end.point


def _off_fog(
    world: World, pencil: Pencil, view: LineOfSight, far_point: Point, sampler: Sampler, add: Add
) -> None:
    """Deposit what fog scatters where the other end looks, equi-angularly or uniformly drawn."""
    media = world.media
    ray, si, far, number = pencil
    near, far = view.overlap(number, ray, far)
    angular = EquiAngular.about(far_point, ray, far, near)
    choice = sampler.next_1d()
    distance = dr.select(
        sampler.next_1d() < 0.5, angular.sample(choice), dr.lerp(near, far, choice)
    )
    density = 0.5 * (angular.density(distance) + dr.rcp(far - near))
    point = mi.Point3f(ray(distance))
    medium = media.pick(point, sampler.next_1d())
    end = view.connect_to(number, point, sampler)
    towards, gap = direction_to(point, end.point)
    value = media.albedo(medium) * media.extinction_at(point) * end.importance / density
    lit = carries_light(value) & (far > near)
    value *= media.phase(medium, point, ray.d, towards, lit)
    light = Scored(value, world.tracked.scattered_by(medium, ray.d, towards, lit))
    light *= world.transmittance(ray, distance, sampler, lit)
    light *= view.transmission(si, point, towards, gap, mi.Bool(True), sampler, lit)
    add(light, distance + gap, 1, lit)


def surface_context(other: Sink) -> Object:
    """Importance where light leaves for a detector, radiance where it is followed backwards."""
    outward = isinstance(other, Detectors)
    return mi.BSDFContext(mi.TransportMode.Importance if outward else mi.TransportMode.Radiance)


def low_discrepancy(this: Source | Lamp, replicas: int, seed: int) -> Lanes:
    """Lanes, their cells and replicas, with a Sobol sequence for each cell and replica."""
    number: UInt = dr.arange(mi.UInt32, replicas * this.lanes)
    count = dr.opaque(mi.UInt32, replicas)
    lane, replica = number // count, number % count
    cell = this.cell(lane)
    cells = this.lanes // this.samples
    points = Points.of(lane // cells, cell * count + replica, dr.opaque(mi.UInt32, seed))
    return lane, cell, replica, points
