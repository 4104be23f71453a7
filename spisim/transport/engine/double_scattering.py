"""Light scattered once by fog and once by a surface, which dominates the blur of an image.

Walks sample this light badly: they seldom collide in thin fog, and a walk from the detector brings
it to any pixel. Here the rays of pixels and lasers are followed instead. The only random choices
are where and by how much the fog bends the light:

* **Behind the surface.** From the surface S that a ray meets, via the fog at X, to the other end D.
  X lies at t along the line SD, offset so that the bend follows the phase function (joint
  importance sampling: Georgiev et al., ACM TOG 32(6), 164 (2013)). This cancels the two inverse
  squared distances and the phase function: the rest is at most π times its value for a small bend
  anywhere on the line, times the BSDF of the surface.
* **In front of it.** X is anywhere on the ray, the bend follows the phase function, and S is the
  surface that the bent ray meets.

The first covers X between the planes through S and D across their line. All other light of this
kind is left to the walks.
"""

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.beams import Beams
from spisim.transport.engine.direct import Pencil, low_discrepancy, surface_context
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.lights import Lamp
from spisim.transport.engine.tally import Contribution, Deposit, carries_light
from spisim.transport.geometry import direction_to
from spisim.transport.jit import Bool, Float, Hit, Point, Sampler
from spisim.transport.scores import Scored
from spisim.transport.world import World

#: Below this extinction (1/m) the fog of a ray counts as uniform.
THIN_PER_M = 1e-4


def double_scattering_light(
    world: World,
    this: Projector | Beams,
    other: Detectors | Lamp,
    seed: int,
    deposit: Deposit,
    *,
    replicas: int = 1,
) -> None:
    """Deposit what each lane's ray sends to the other end by way of fog and a surface."""
    lane, cell, replica, points = low_discrepancy(this, replicas, seed ^ 2)  # another stream
    ray, weight = this.pencil(lane, points)
    pencil = Pencil(ray, *world.first_surface(ray), other.choose(lane, points))
    for strategy in (_behind_surface, _before_surface):
        light, length_m, lit = strategy(world, pencil, other, points)
        value, order = light.value * weight, mi.UInt32(1)
        deposit(Contribution(value, cell, length_m, order, lit, replica, light.scores))


def estimated_along_rays(first: Point, second: Point, end: Point, surface_first: Bool) -> Bool:
    """Whether two vertices, one in fog and one on a surface, are covered by rays."""
    between = (dr.dot(second - first, end - first) > 0) & (dr.dot(second - end, first - end) > 0)
    return ~surface_first | between


def _behind_surface(
    world: World, pencil: Pencil, other: Detectors | Lamp, points: Sampler
) -> tuple[Scored, Float, Bool]:
    """Value, path length and lanes of light that goes from the surface through the fog."""
    ray, si, far, number = pencil
    media = world.media
    aperture = points.again()  # the same point on the aperture for both connections
    end = other.connect_to(number, si.p, points).point
    axis, length_m = direction_to(si.p, end)
    choice = points.next_1d()
    along = points.next_1d()
    t = length_m * dr.select(choice < 0.5, along, dr.square(dr.sin(0.5 * dr.pi * along)))
    root = dr.sqrt(t * (length_m - t))
    bent = media.bend(axis, points)
    cosine = dr.dot(axis, bent)
    aside = bent - axis * cosine
    sine = dr.maximum(dr.norm(aside), 1e-12)
    spread = dr.sqrt(dr.square(length_m * cosine) + dr.square(2 * root * sine))
    r = dr.select(
        cosine > 0,
        2 * dr.square(root) * sine / (length_m * cosine + spread),
        (spread - length_m * cosine) / (2 * sine),
    )
    point = mi.Point3f(si.p + t * axis + (r / sine) * aside)
    outgoing, first_m = direction_to(si.p, point)
    seen = other.connect_to(number, point, aperture)
    onward, second_m = direction_to(point, seen.point)
    lit = si.is_valid() & (first_m > 0) & (second_m > 0) & (seen.importance > 0)  # by rounding
    parts, density = media.bending(point, outgoing, onward, lit)
    scattered: Float = sum(parts)
    density *= 0.5 / length_m + 0.5 / (dr.pi * root)
    density *= length_m / (first_m * second_m)
    density *= t / dr.square(first_m) + (length_m - t) / dr.square(second_m)
    light = world.reflected(surface_context(other), si, outgoing, lit)
    light *= Scored(
        scattered * seen.importance / (density * dr.square(first_m)),
        world.tracked.scattered(lambda number: parts[number] / scattered, outgoing, onward),
    )
    lit &= (density > 0) & carries_light(light.value)
    light *= world.geometry.transmission(si, si.p, outgoing, first_m, mi.Bool(False), lit)
    light *= world.geometry.between(point, onward, second_m, lit)
    light *= world.transmittance(ray, far, points, lit)
    light *= world.transmittance(mi.Ray3f(si.p, outgoing), first_m, points, lit)
    light *= world.transmittance(mi.Ray3f(point, onward), second_m, points, lit)
    return light, far + first_m + second_m, lit & carries_light(light.value)


def _before_surface(
    world: World, pencil: Pencil, other: Detectors | Lamp, points: Sampler
) -> tuple[Scored, Float, Bool]:
    """Value, path length and lanes of light that goes from the fog to a surface."""
    ray, _, far, number = pencil
    media = world.media
    distance, density = _anywhere(media.extinction_at(ray.o), far, points)
    point = mi.Point3f(ray(distance))
    medium = media.pick(point, points.next_1d())
    choice, square = points.next_1d(), points.next_2d()
    bent, scale, _ = media.scatter(medium, point, ray.d, choice, square, mi.Bool(True))
    value = media.albedo(medium) * media.extinction_at(point) * scale / density
    onward = mi.Ray3f(point, bent)
    si: Hit = world.geometry.scene.ray_intersect(onward, carries_light(value))
    end = other.connect_to(number, si.p, points)
    towards, gap = direction_to(si.p, end.point)
    light = Scored(value, world.tracked.scattered_by(medium, ray.d, bent, carries_light(value)))
    light *= world.reflected(surface_context(other), si, towards, si.is_valid()) * end.importance
    lit = si.is_valid() & carries_light(light.value)
    light *= world.geometry.transmission(si, si.p, towards, gap, mi.Bool(False), lit)
    light *= world.transmittance(ray, distance, points, lit)
    light *= world.transmittance(mi.Ray3f(point, bent), si.t, points, lit)
    light *= world.transmittance(mi.Ray3f(si.p, towards), gap, points, lit)
    return light, distance + si.t + gap, lit & carries_light(light.value)


def _anywhere(extinction_per_m: Float, far: Float, points: Sampler) -> tuple[Float, Float]:
    """A distance and its density: half uniform, half exponential, which suits thick fog."""
    rate = dr.maximum(extinction_per_m, THIN_PER_M)
    lost = 1 - dr.exp(-rate * far)
    choice, along = points.next_1d(), points.next_1d()
    distance = dr.select(choice < 0.5, along * far, -dr.log(1 - along * lost) / rate)
    return distance, 0.5 * (dr.rcp(far) + rate * dr.exp(-rate * distance) / lost)
