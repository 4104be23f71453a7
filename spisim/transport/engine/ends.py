"""The ends of light paths, and the projector; `apertures`, `beams` and `lights` have more ends.

An end is described by its importance W(ω): a path p → x₁ → … → xₙ → y carries the fraction

    W_P(ω₀) · Π (scattering · transmittance / distance²) · W_D(ωₙ)

of the emitted power onto unit detector area. Paths are launched with a number density (number of
paths x density of the direction, 1/sr) in proportion to W, or close to it. In these terms all ends
are alike, and one walk serves any pair of them.

An end offers `launch`, which starts paths, and `density`, the number density of these launches; or
`connect`, where a path from the other side may end; or both.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.instrument.views import ProjectorView
from spisim.transport.geometry import transform
from spisim.transport.jit import Float, Matrix, Point, Point2, Ray, Sampler, UInt, Vector
from spisim.transport.scores import NO_SCORES, Scores


class Launch(NamedTuple):
    """Paths that leave an end: origin, direction, and W / density."""

    origin: Point
    direction: Vector
    beta: Float
    state: Any  # input of `density`
    cell: UInt  # accumulator cell, None where the other end determines it
    length_m: Float = 0.0  # optical path from the emitter to `origin`
    scatterings: UInt = 0  # in fog, before `origin`
    crossings: UInt = 0  # surfaces passed straight through before `origin`
    replica: UInt = 0  # index of the replica that the path belongs to
    scores: Scores = NO_SCORES  # of the way to `origin` and its turn there


class Connection(NamedTuple):
    """An end seen from a path vertex."""

    point: Point  # where the path ends
    importance: Float  # W / distance² towards the vertex; 0 outside the field
    density: Float  # number density / distance² with which the end itself launches paths that way
    length_m: Float  # optical path from `point` on to the emitter
    scatterings: UInt  # in fog, from `point` on to the emitter
    cell: UInt  # accumulator cell, None where the other end determines it
    scores: Scores = NO_SCORES  # of the turn at `point` and the way on to the emitter


class RandomRay(NamedTuple):
    """A random ray from the whole field of an end."""

    ray: Ray
    weight: Float  # W / density
    launched: Float  # number density of launched paths, over this one
    cell: UInt  # accumulator cell, None where the other end determines it


@dataclass(frozen=True, eq=False)
class Projector:
    """Lens whose virtual pixels emit unit power each, uniform over their image-plane area.

    W(ω) = cosᵏθ / (a_u cos³θ), with a_u the area of pixel u on the image plane at unit distance and
    the falloff k, 0 by default; launches leave out cosᵏθ. The lens is a point, or a disc focused at
    a distance: a pixel's light then leaves from all over the disc towards the pixel's point in the
    focal plane. A launch has `samples` paths per pixel, or one path per `group` of neighbours, from
    one of them at random.
    """

    to_world: Matrix
    to_optical: Matrix
    shape: tuple[int, int]
    half_width: Float
    half_height: Float
    lens_radius_m: Float
    focus_m: Float
    falloff: Float | None  # k; None for 0
    samples: int
    group: int
    samples_jit: Float  # samples / group, opaque: one kernel serves any number

    @classmethod
    def of(cls, view: ProjectorView, samples: float) -> Self:
        """Convert a view; `samples` is whole, or 1 / n with n a divisor of the number of pixels."""
        return cls(
            to_world=transform(view.pose),
            to_optical=transform(np.linalg.inv(view.pose)),
            shape=view.shape,
            half_width=dr.opaque(mi.Float, view.tan_half_width),
            half_height=dr.opaque(mi.Float, view.tan_half_height),
            lens_radius_m=dr.opaque(mi.Float, view.lens_radius_m),
            focus_m=dr.opaque(mi.Float, view.focus_m),
            falloff=dr.opaque(mi.Float, view.falloff) if view.falloff else None,
            samples=max(1, int(samples)),
            group=max(1, round(1 / samples)),
            samples_jit=dr.opaque(mi.Float, samples),
        )

    def times(self, factor: int) -> Self:
        """The same projector with `factor` times the paths: at least one per pixel."""
        samples = factor * self.samples // self.group
        return replace(self, samples=samples, group=1, samples_jit=dr.opaque(mi.Float, samples))

    @property
    def pixels(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def lanes(self) -> int:
        return self.pixels * self.samples // self.group

    @property
    def paths(self) -> Float:
        """Paths of a launch that may reach the same detector."""
        return self.pixels * self.samples_jit

    @property
    def middle(self) -> Point:
        """Centre of the lens, world."""
        return self.to_world @ mi.Point3f(0)

    def cell(self, lane: UInt) -> UInt:
        return lane % self.pixels

    def pencil(self, lane: UInt, sampler: Sampler) -> tuple[Ray, Float]:
        """A ray through the lane's pixel, and its weight."""
        ray = self._through(self.cell(lane), sampler.next_2d(), sampler)
        return ray, self._dimmed(dr.rcp(self.samples_jit), ray.d)

    def _through(self, cell: UInt, jitter: Point2, sampler: Sampler) -> Ray:
        """A ray through a jittered point of a pixel."""
        height, width = self.shape
        x = (2 * (mi.Float(cell % width) + jitter.x) / width - 1) * self.half_width
        y = (2 * (mi.Float(cell // width) + jitter.y) / height - 1) * self.half_height
        return self._ray(x, y, sampler)

    def launch(self, lane: UInt, sampler: Sampler) -> Launch:
        jitter = stratified(lane // self.pixels, self.samples, sampler)
        group = dr.opaque(mi.UInt32, self.group)
        member = dr.minimum(mi.UInt32(sampler.next_1d() * mi.Float(group)), group - 1)
        cell = self.cell(lane * group + member)
        ray = self._through(cell, jitter, sampler)
        return Launch(
            origin=ray.o,
            direction=ray.d,
            beta=self._dimmed(dr.rcp(self.samples_jit), ray.d),
            state=self.samples_jit * self.importance_of(ray.d),
            cell=cell,
        )

    def density(self, launch: Launch, first_vertex: Point) -> Float:
        return launch.state

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        lens = self._lens_point(sampler)
        towards = mi.Vector3f((self.to_optical @ mi.Point3f(vertex)) - lens)
        focal = (lens + towards * (self.focus_m / towards.z)) / self.focus_m
        height, width = self.shape
        u = (focal.x / self.half_width + 1) * (0.5 * width)
        v = (focal.y / self.half_height + 1) * (0.5 * height)
        inside = (towards.z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        squared = dr.squared_norm(towards)
        importance = dr.select(
            inside, self.importance_at(towards.z * dr.rsqrt(squared)) / squared, 0
        )
        return Connection(
            point=self.to_world @ lens,
            importance=self._dimmed(importance, self.to_world @ towards),
            density=self.samples_jit * importance,
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            cell=dr.select(inside, mi.UInt32(v) * width + mi.UInt32(u), 0),
        )

    def random_ray(self, sampler: Sampler) -> RandomRay:
        """A ray through a random point of the field."""
        ray, pixel = self.ray_at(sampler.next_2d(), sampler)
        return RandomRay(ray, self._dimmed(mi.Float(self.pixels), ray.d), self.paths, pixel)

    def random_ray_density(self, direction: Vector, lens: Point) -> Float:
        """Density of `random_ray`, 1/sr, for a ray that leaves the point `lens` (world)."""
        return self.importance_towards(direction, lens) / self.pixels

    def ray_at(self, square: Point2, sampler: Sampler) -> tuple[Ray, UInt]:
        """The ray through a point of the field, given in the unit square, and its pixel."""
        height, width = self.shape
        x, y = 2 * square.x - 1, 2 * square.y - 1
        pixel = mi.UInt32(square.y * height) * width + mi.UInt32(square.x * width)
        ray = self._ray(x * self.half_width, y * self.half_height, sampler)
        return ray, dr.minimum(pixel, self.pixels - 1)

    def overlap(self, ray: Ray, far: Float) -> tuple[Float, Float]:
        """Part of a ray within the field: |x| ≤ z tan α + r (1 + z / f), and y likewise."""
        start = self.to_optical @ mi.Point3f(ray.o)
        step = self.to_optical @ mi.Vector3f(ray.d)
        near, far = mi.Float(0), mi.Float(far)
        blur = self.lens_radius_m / self.focus_m
        for half, begin, slope in (
            (self.half_width, start.x, step.x),
            (self.half_height, start.y, step.y),
        ):
            for side in (-1, 1):
                # Inside where room + opening · distance is positive
                room = (half + blur) * start.z + self.lens_radius_m + side * begin
                opening = (half + blur) * step.z + side * slope
                crossing = -room / opening
                near = dr.select(opening > 0, dr.maximum(near, crossing), near)
                far = dr.select(opening < 0, dr.minimum(far, crossing), far)
        return near, far

    def _ray(self, x: Float, y: Float, sampler: Sampler) -> Ray:
        """Ray from a random lens point through (x, y) on the image plane at unit distance."""
        lens = self._lens_point(sampler)
        local = dr.normalize(mi.Vector3f(mi.Point3f(x, y, 1) * self.focus_m - lens))
        return mi.Ray3f(self.to_world @ lens, self.to_world @ local)

    def _dimmed(self, value: Float, direction: Vector) -> Float:
        """A value times cosᵏθ of a direction (world, of any length) in the field."""
        if self.falloff is None:
            return value
        cosine = dr.normalize(self.to_optical @ mi.Vector3f(direction)).z
        return value * dr.power(dr.maximum(cosine, 1e-6), self.falloff)

    def importance_of(self, direction: Vector) -> Float:
        """W / cosᵏθ of a drawn ray, in the field even if rounding puts it on the edge."""
        return self.importance_at((self.to_optical @ mi.Vector3f(direction)).z)

    def importance_towards(self, direction: Vector, lens: Point) -> Float:
        """W / cosᵏθ of the ray that leaves the point `lens` (world); 0 outside the field."""
        local = self.to_optical @ mi.Vector3f(direction)
        origin = self.to_optical @ mi.Point3f(lens)
        focal = (origin + local * (self.focus_m / local.z)) / self.focus_m
        inside = (
            (local.z > 0)
            & (dr.abs(focal.x) < self.half_width)
            & (dr.abs(focal.y) < self.half_height)
        )
        return dr.select(inside, self.importance_at(local.z), 0)

    def _lens_point(self, sampler: Sampler) -> Point:
        disc = mi.warp.square_to_uniform_disk_concentric(sampler.next_2d()) * self.lens_radius_m
        return mi.Point3f(disc.x, disc.y, 0)

    def importance_at(self, cosine: Float) -> Float:
        """W / cosᵏθ by the cosine to the axis, inside the field."""
        pixel_area = 4 * self.half_width * self.half_height / self.pixels
        return dr.rcp(pixel_area * cosine**3)


def stratified(index: UInt, count: int, sampler: Sampler) -> Point2:
    """Jittered point of the unit square in stratum `index` of a grid of `count` strata."""
    across = next(side for side in range(int(np.sqrt(count)), 0, -1) if count % side == 0)
    rows, columns = (dr.opaque(mi.UInt32, side) for side in (across, count // across))
    jitter = sampler.next_2d()
    return mi.Point2f(
        (mi.Float(index % columns) + jitter.x) / columns,
        (mi.Float(index // columns % rows) + jitter.y) / rows,
    )
