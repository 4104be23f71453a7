"""Scattering media between the surfaces: any number, homogeneous or not, bounded or not.

Overlapping media add up. Collisions with each are independent Poisson processes along a ray, so the
first collision of all is the nearest of their first collisions, and their transmittances multiply.
A homogeneous medium has both in closed form. A heterogeneous one is tracked: null-collision (delta)
tracking for the flight, ratio tracking for the transmittance (Novák et al., Computer Graphics Forum
37, 551 (2018)). Distances are always those between points, so null collisions do not change an
optical path length.

Flights that leave an end of a path are biased towards collisions, because light scattered there by
thin fog is rare and bright (exponential biasing, Spanier & Gelbard 1969, §3.3, with a rate that
falls with the distance).
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.atmosphere import Blend, HenyeyGreenstein, Isotropic, Phase, Tabulated
from spisim.transport.bounds import Bounds, Box
from spisim.transport.jit import Bool, Float, Object, Point, Point2, Ray, Sampler, UInt, Vector

#: Where flights leave an end, the maximum rate of collisions relative to the true one,
BIAS = 5.0
#: the maximum distance over which they are biased, unless the mean free path is shorter,
BIAS_MAX_RANGE_M = 3.0
#: and the maximum total optical depth that the bias adds, which bounds the weights.
BIAS_DEPTH = 1.5


@dataclass(frozen=True, eq=False)
class Bias:
    """Extra extinction of flights over the true one: c / (1 + (s/b)²), s after the path's end."""

    strength: Float  # c
    max_range_m: Float  # b

    @classmethod
    def of(cls, extinction_per_m: float) -> Self:
        """Bias of a medium with this extinction."""
        max_range_m = min(BIAS_MAX_RANGE_M, 1 / extinction_per_m)
        strength = min(BIAS - 1, BIAS_DEPTH / (extinction_per_m * max_range_m * np.pi / 2))
        return cls(dr.opaque(mi.Float, strength), dr.opaque(mi.Float, max_range_m))

    def length_m(self, near: Float, far: Float) -> Float:
        """Integral of the multiple from one distance to another."""
        angle = dr.atan(far / self.max_range_m) - dr.atan(near / self.max_range_m)
        return self.strength * self.max_range_m * angle

    def way_m(self, near: Float, length_m: Float) -> Float:
        """Distance beyond `near` where the integral is `length_m`; infinite if it never is."""
        angle = dr.atan(near / self.max_range_m) + length_m / (self.strength * self.max_range_m)
        return dr.select(angle < 0.5 * dr.pi, self.max_range_m * dr.tan(angle) - near, dr.inf)

    def factor(self, distance: Float) -> Float:
        """Total extinction over the true one."""
        return 1 + self.strength / (1 + dr.square(distance / self.max_range_m))


@dataclass(frozen=True, eq=False)
class Homogeneous:
    """Constant extinction within bounds."""

    bounds: Bounds
    extinction_per_m: Float
    albedo: Float
    phase: Object
    bias: Bias
    in_closed_form = True

    def flight(self, ray: Ray, far: Float, sampler: Sampler, active: Bool, left_m: Float) -> Float:
        near, far = self.bounds.interval(ray, far)
        free, biased = (
            -dr.log(1 - sampler.next_1d(active)) / self.extinction_per_m for _ in range(2)
        )
        distance = near + dr.minimum(free, self.bias.way_m(left_m + near, biased))
        return dr.select(distance < far, distance, dr.inf)

    def bias_depth(self, ray: Ray, far: Float, left_m: Float) -> Float:
        """Optical depth that the bias adds."""
        near, far = self.bounds.interval(ray, far)
        length_m = self.bias.length_m(left_m + near, left_m + dr.maximum(far, near))
        return self.extinction_per_m * length_m

    def transmittance(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        return dr.exp(-self.depth(ray, far, sampler, active))

    def depth(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        near, far = self.bounds.interval(ray, far)
        return self.extinction_per_m * dr.maximum(far - near, 0)

    def extinction_at(self, point: Point) -> Float:
        upwards = mi.Ray3f(point, mi.Vector3f(0, 0, 1))
        near, far = self.bounds.interval(upwards, mi.Float(dr.inf))
        return dr.select((near == 0) & (far > 0), self.extinction_per_m, 0)


@dataclass(frozen=True, eq=False)
class Grid:
    """Extinction σ · density within bounds; the density, 0 to 1, is a grid that fills a box."""

    box: Box
    density: Object  # mi.Texture3f
    extinction_per_m: Float
    albedo: Float
    phase: Object
    bounds: Bounds
    in_closed_form = False

    def flight(self, ray: Ray, far: Float, sampler: Sampler, active: Bool, left_m: Float) -> Float:
        near, end = self.bounds.interval(ray, far)
        return self.collision(ray, near, end, 1, sampler, active)

    def transmittance(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        near, end = self.bounds.interval(ray, far)
        return self.tracked(ray, near, end, 1, sampler, active)

    def depth(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        near, end = self.bounds.interval(ray, far)
        position = ray(dr.lerp(near, end, sampler.next_1d(active)))
        depth = self.extinction_per_m * self.density_at(position) * (end - near)
        return dr.select(near < end, depth, 0)

    @dr.syntax
    def collision(
        self, ray: Ray, near: Float, end: Float, times: Float, sampler: Sampler, active: Bool
    ) -> Float:
        """First collision at `times` the extinction, else infinite, by null-collision tracking."""
        distance = mi.Float(near)
        collision = mi.Float(dr.inf)
        going = active & (near < end)
        while dr.hint(going, exclude=[self, ray, end, times]):
            distance -= dr.log(1 - sampler.next_1d(going)) / (self.extinction_per_m * times)
            going &= distance < end
            position = ray.o + distance * ray.d
            real = going & (sampler.next_1d(going) < self.density_at(position))
            collision = dr.select(real, distance, collision)
            going &= ~real
        return collision

    @dr.syntax
    def tracked(
        self, ray: Ray, near: Float, end: Float, times: Float, sampler: Sampler, active: Bool
    ) -> Float:
        """Transmittance from `near` to `end`, by ratio tracking."""
        distance = mi.Float(near)
        through = mi.Float(1)
        going = active & (near < end)
        while dr.hint(going, exclude=[self, ray, end, times]):
            distance -= dr.log(1 - sampler.next_1d(going)) / (self.extinction_per_m * times)
            going &= distance < end
            free = 1 - self.density_at(ray.o + distance * ray.d)
            through = dr.select(going, through * free, through)
            going &= through > 0
        return through

    def extinction_at(self, point: Point) -> Float:
        inside = self.bounds.contains(point)
        return dr.select(inside, self.extinction_per_m * self.density_at(point), 0)

    def density_at(self, point: Point) -> Float:
        """Density, 0 to 1."""
        local = self.box.to_local @ mi.Point3f(point)
        return self.density.eval(local)[0]


class Medium(Protocol):
    """One of the media of a scene."""

    @property
    def albedo(self) -> Float:
        """Single-scattering albedo."""

    @property
    def phase(self) -> Float:
        """Mitsuba's phase function."""

    @property
    def in_closed_form(self) -> bool:
        """Whether the transmittance has a closed form."""

    def flight(self, ray: Ray, far: Float, sampler: Sampler, active: Bool, left_m: Float) -> Float:
        """Distance to the first collision, infinite where there is none before `far`."""

    def transmittance(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        """Fraction of light that gets `far` without a collision, or an unbiased estimate of it."""

    def depth(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        """Optical depth up to `far`, or an unbiased estimate of it with its own random number."""

    def extinction_at(self, point: Point) -> Float:
        """Extinction, 1/m."""


class Collision(NamedTuple):
    """Distance to a collision, and the medium that it is with."""

    distance: Float  # infinite where there is none
    medium: UInt  # index


@dataclass(frozen=True, eq=False)
class Media:
    """All media of a scene; empty for clear air."""

    parts: tuple[Medium, ...]

    def flight(
        self, ray: Ray, far: Float, sampler: Sampler, active: Bool, left_m: Float = dr.inf
    ) -> Collision:
        """First collision along the ray before `far`; its density is `flight_density`."""
        nearest, which = mi.Float(dr.inf), mi.UInt32(0)
        for number, part in enumerate(self.parts):
            distance = part.flight(ray, far, sampler, active, left_m)
            which = dr.select(distance < nearest, number, which)
            nearest = dr.minimum(distance, nearest)
        return Collision(nearest, which)

    def flight_density(
        self, ray: Ray, distance: Float, medium: UInt, in_fog: Bool, left_m: Float
    ) -> Float:
        """Density of a flight that began `left_m` after the path's end, over that of light."""
        depth, factor = mi.Float(0), mi.Float(1)
        for number, part in enumerate(self.parts):
            if isinstance(part, Homogeneous):
                depth += part.bias_depth(ray, distance, left_m)
                here = in_fog & (medium == number)
                factor = dr.select(here, part.bias.factor(left_m + distance), factor)
        return factor * dr.exp(-depth)

    def transmittance(self, ray: Ray, far: Float, sampler: Sampler, active: Bool) -> Float:
        """Fraction of light that gets `far` without a collision, or an unbiased estimate of it."""
        through = mi.Float(1)
        for part in self.parts:
            through *= part.transmittance(ray, far, sampler, active)
        return through

    def closed_form_transmittance(self, ray: Ray, far: Float) -> Float:
        """The factors of the transmittance that have a closed form."""
        through = mi.Float(1)
        for part in self.parts:
            if part.in_closed_form:
                through *= part.transmittance(ray, far, None, mi.Bool(True))
        return through

    def albedo(self, medium: UInt) -> Float:
        """Albedo of the medium with this index."""
        value = mi.Float(1)
        for number, part in enumerate(self.parts):
            value = dr.select(medium == number, part.albedo, value)
        return value

    def phase(
        self, medium: UInt, point: Point, incoming: Vector, outgoing: Vector, active: Bool
    ) -> Float:
        """Phase function, 1/sr, which by symmetry is also the density either way."""
        value = mi.Float(0)
        interaction, outgoing = _interaction(point, incoming), _within(incoming, outgoing)
        for number, part in enumerate(self.parts):
            chosen = active & (medium == number)
            density, _ = part.phase.eval_pdf(
                mi.PhaseFunctionContext(), interaction, outgoing, chosen
            )
            value = dr.select(chosen, density.x, value)
        return value

    def scatter(
        self,
        medium: UInt,
        point: Point,
        incoming: Vector,
        choice: Float,
        square: Point2,
        active: Bool,
    ) -> tuple[Vector, Float, Float]:
        """New direction, its weight and its density (1/sr)."""
        direction, weight, density = mi.Vector3f(incoming), mi.Float(0), mi.Float(1)
        interaction = _interaction(point, incoming)
        for number, part in enumerate(self.parts):
            chosen = active & (medium == number)
            scattered, scale, pdf = part.phase.sample(
                mi.PhaseFunctionContext(), interaction, choice, square, chosen
            )
            direction = dr.select(chosen, scattered, direction)
            weight = dr.select(chosen, scale.x, weight)
            density = dr.select(chosen, pdf, density)
        return direction, weight, density

    def bend(self, incoming: Vector, sampler: Sampler) -> Vector:
        """A direction scattered by a random medium; `bending` has its density."""
        count = len(self.parts)
        medium = dr.minimum(mi.UInt32(sampler.next_1d() * count), count - 1)
        choice, square = sampler.next_1d(), sampler.next_2d()
        point = mi.Point3f(0)  # phase functions are the same everywhere
        return self.scatter(medium, point, incoming, choice, square, mi.Bool(True))[0]

    def bending(
        self, point: Point, incoming: Vector, outgoing: Vector, active: Bool
    ) -> tuple[list[Float], Float]:
        """What each medium scatters between two directions, 1/(m sr), and the density of `bend`."""
        scattered, density = [], mi.Float(0)
        context, interaction = mi.PhaseFunctionContext(), _interaction(point, incoming)
        outgoing = _within(incoming, outgoing)
        for part in self.parts:
            phase, _ = part.phase.eval_pdf(context, interaction, outgoing, active)
            scattered.append(part.albedo * part.extinction_at(point) * phase.x)
            density += phase.x / len(self.parts)
        return scattered, density

    def extinction_at(self, point: Point) -> Float:
        """Extinction of all media together, 1/m."""
        total: Float = mi.Float(0)
        for part in self.parts:
            total += part.extinction_at(point)
        return total

    def pick(self, point: Point, choice: Float) -> UInt:
        """Index of a medium, drawn in proportion to its extinction at a point."""
        mark = choice * self.extinction_at(point)
        medium, below = mi.UInt32(0), mi.Float(0)
        for number, part in enumerate(self.parts[:-1]):
            below += part.extinction_at(point)
            medium = dr.select(mark >= below, number + 1, medium)
        return medium


def _interaction(point: Point, incoming: Vector) -> Object:
    interaction: Object = dr.zeros(mi.MediumInteraction3f)
    interaction.p = point
    interaction.wi = -incoming
    interaction.sh_frame = mi.Frame3f(interaction.wi)
    return interaction


def _within(incoming: Vector, outgoing: Vector) -> Vector:
    """`outgoing`, shortened where rounding makes the cosine exceed 1: tables are zero there."""
    cosine: Float = dr.abs(dr.dot(incoming, outgoing))
    return outgoing * dr.select(cosine > 1, (1 - 2.0**-22) / cosine, 1)


def density_texture(density: NDArray[np.float32]) -> Object:
    """A grid (nz, ny, nx) of cell-centred values over the unit cube, linear between, clamped."""
    texture: Object = mi.Texture3f
    return texture(
        mi.TensorXf(np.ascontiguousarray(density, dtype=np.float32)[..., None]),
        wrap_mode=dr.WrapMode.Clamp,
        filter_mode=dr.FilterMode.Linear,
    )


def phase_plugin(phase: Phase) -> Object:
    """A phase function as a Mitsuba plugin; needs an active variant."""
    match phase:
        case Isotropic():
            return mi.load_dict({"type": "isotropic"})
        case HenyeyGreenstein(g=g):
            return mi.load_dict({"type": "hg", "g": g})
        case Tabulated():
            return _table(phase)
        case Blend(parts=((_, only),)):
            return phase_plugin(only)
        case Blend(parts=((weight, first), *others)):
            rest = Blend(tuple((fraction / (1 - weight), other) for fraction, other in others))
            return mi.load_dict(
                {
                    "type": "blendphase",
                    "weight": 1 - weight,
                    "first": phase_plugin(first),
                    "second": phase_plugin(rest),
                }
            )
    raise TypeError(f"not a phase function: {phase!r}")


def _table(phase: Tabulated) -> Object:
    """Set the table by parameter: as text, which the plugin takes, it has megabytes."""
    plugin = mi.load_dict({"type": "tabphase", "values": "1, 1"})
    parameters = mi.traverse(plugin)
    parameters["values"] = mi.Float(phase.values)
    parameters.update()
    return plugin
