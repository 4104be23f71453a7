"""The ends of every light path: projector and detectors; `lights` has more.

An end is described by its importance W(ω): a path p → x₁ → … → xₙ → y carries the fraction

    W_P(ω₀) · Π (scattering · transmittance / distance²) · W_D(ωₙ)

of the emitted power onto unit detector area. Paths are launched with a number density (number of
paths x density of the direction, 1/sr) that is proportional to W, or close to it. Seen like this
all ends are alike, and one walk serves any pair of them.

An end offers `launch`, which starts paths, and `density`, the number density with which it did;
`connect`, where a path of the other side may end; or both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.transport.geometry import transform
from spisim.transport.views import DetectorView, ProjectorView


class Launch(NamedTuple):
    """Paths that leave an end: where, whereto, and W / density."""

    origin: Any
    direction: Any
    beta: Any
    length_m: Any  # optical path from the emitter to `origin`
    scatterings: Any  # in fog, before `origin`
    state: Any  # what `density` needs to know
    cell: Any  # accumulator cell, None where the other end tells it
    replica: Any = 0  # which of the estimates side by side the path is part of


class Connection(NamedTuple):
    """An end seen from a path vertex."""

    point: Any  # where the path ends
    importance: Any  # W / distance² towards the vertex; 0 where the end does not look
    density: Any  # number density / distance² with which the end itself launches paths that way
    length_m: Any  # optical path from `point` on to the emitter
    scatterings: Any  # in fog, from `point` on to the emitter
    cell: Any  # accumulator cell, None where the other end tells it


class RandomRay(NamedTuple):
    """A ray out of the whole field of an end."""

    ray: Any
    weight: Any  # W / density
    launched: Any  # number density of paths that are launched, over this one
    cell: Any  # accumulator cell, None where the other end tells it


@dataclass(frozen=True, eq=False)
class Projector:
    """Lens whose virtual pixels emit unit power each, uniform over their image-plane area.

    W(ω) = 1 / (a_u cos³θ), with a_u the area of pixel u on the image plane at unit distance. The
    lens is a point, or a disc that is focused at a distance: a pixel's light then leaves all over
    the disc towards the pixel's place in the focal plane. `samples` paths per pixel and launch.
    """

    to_world: Any
    to_optical: Any
    shape: tuple[int, int]
    half_width: Any
    half_height: Any
    lens_radius_m: Any
    focus_m: Any
    samples: int
    rate: Any  # the same for kernels, which then do for any number

    @classmethod
    def of(cls, view: ProjectorView, samples: int) -> Projector:
        """Take a projector's place in the world from its numbers."""
        return cls(
            to_world=transform(view.pose),
            to_optical=transform(np.linalg.inv(view.pose)),
            shape=view.shape,
            half_width=dr.opaque(mi.Float, view.tan_half_width),
            half_height=dr.opaque(mi.Float, view.tan_half_height),
            lens_radius_m=dr.opaque(mi.Float, view.lens_radius_m),
            focus_m=dr.opaque(mi.Float, view.focus_m),
            samples=samples,
            rate=dr.opaque(mi.Float, samples),
        )

    def times(self, factor: int) -> Projector:
        """The same with so many times the paths."""
        return replace(self, samples=factor * self.samples, rate=factor * self.rate)

    @property
    def pixels(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def lanes(self) -> int:
        return self.pixels * self.samples

    @property
    def paths(self) -> Any:
        """Paths of a launch that may reach one and the same detector."""
        return self.pixels * self.rate

    @property
    def middle(self) -> Any:
        """Of the lens."""
        return self.to_world @ mi.Point3f(0)

    def cell(self, lane: Any) -> Any:
        return lane % self.pixels

    def pencil(self, lane: Any, sampler: Any) -> tuple[Any, Any]:
        """A ray through the lane's pixel, and its weight."""
        return self._through(lane, sampler.next_2d(), sampler), dr.rcp(self.rate)

    def _through(self, lane: Any, jitter: Any, sampler: Any) -> Any:
        """A ray through a place in the lane's pixel."""
        cell = self.cell(lane)
        height, width = self.shape
        x = (2 * (mi.Float(cell % width) + jitter.x) / width - 1) * self.half_width
        y = (2 * (mi.Float(cell // width) + jitter.y) / height - 1) * self.half_height
        return self._ray(x, y, sampler)

    def launch(self, lane: Any, sampler: Any) -> Launch:
        jitter = stratified(lane // self.pixels, self.samples, sampler)
        ray = self._through(lane, jitter, sampler)
        return Launch(
            origin=ray.o,
            direction=ray.d,
            beta=dr.rcp(self.rate),
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            state=self.rate * self.importance_of(ray.d),
            cell=self.cell(lane),
        )

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        return launch.state

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
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
            importance=importance,
            density=self.rate * importance,
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            cell=dr.select(inside, mi.UInt32(v) * width + mi.UInt32(u), 0),
        )

    def random_ray(self, sampler: Any) -> RandomRay:
        """A ray through a random point of the field."""
        ray, pixel = self.ray_at(sampler.next_2d(), sampler)
        return RandomRay(ray, mi.Float(self.pixels), self.paths, pixel)

    def random_ray_density(self, direction: Any, lens: Any) -> Any:
        """Of `random_ray`, 1/sr, for a ray that leaves the lens at a place (world)."""
        return self.importance_towards(direction, lens) / self.pixels

    def ray_at(self, place: Any, sampler: Any) -> tuple[Any, Any]:
        """The ray through a place of the field, a point of the unit square, and its pixel."""
        height, width = self.shape
        x, y = 2 * place.x - 1, 2 * place.y - 1
        pixel = mi.UInt32(place.y * height) * width + mi.UInt32(place.x * width)
        ray = self._ray(x * self.half_width, y * self.half_height, sampler)
        return ray, dr.minimum(pixel, self.pixels - 1)

    def overlap(self, ray: Any, reach: Any) -> tuple[Any, Any]:
        """Part (near, far) of a ray that may be lit: within the four sides of the field.

        |x| ≤ z tan α + r (1 + z / f) of a lens of radius r that is focused at f, and y likewise.
        """
        start = self.to_optical @ mi.Point3f(ray.o)
        step = self.to_optical @ mi.Vector3f(ray.d)
        near, far = mi.Float(0), mi.Float(reach)
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

    def _ray(self, x: Any, y: Any, sampler: Any) -> Any:
        """From a point of the lens towards (x, y) on the image plane at unit distance."""
        lens = self._lens_point(sampler)
        local = dr.normalize(mi.Vector3f(mi.Point3f(x, y, 1) * self.focus_m - lens))
        return mi.Ray3f(self.to_world @ lens, self.to_world @ local)

    def importance_of(self, direction: Any) -> Any:
        """W of a ray that was drawn: in the field, though rounding may put it on the edge."""
        return self.importance_at((self.to_optical @ mi.Vector3f(direction)).z)

    def importance_towards(self, direction: Any, lens: Any) -> Any:
        """W of the ray that leaves the lens at a place (world); 0 outside the field."""
        local = self.to_optical @ mi.Vector3f(direction)
        origin = self.to_optical @ mi.Point3f(lens)
        focal = (origin + local * (self.focus_m / local.z)) / self.focus_m
        inside = (
            (local.z > 0)
            & (dr.abs(focal.x) < self.half_width)
            & (dr.abs(focal.y) < self.half_height)
        )
        return dr.select(inside, self.importance_at(local.z), 0)

    def _lens_point(self, sampler: Any) -> Any:
        disc = mi.warp.square_to_uniform_disk_concentric(sampler.next_2d()) * self.lens_radius_m
        return mi.Point3f(disc.x, disc.y, 0)

    def importance_at(self, cosine: Any) -> Any:
        """W by the cosine to the axis, inside the field."""
        pixel_area = 4 * self.half_width * self.half_height / self.pixels
        return dr.rcp(pixel_area * cosine**3)


@dataclass(frozen=True, eq=False)
class Detectors:
    """Disc apertures with a conical field of view; every lane has its own one.

    W(ω) = g(θ) cosθ inside the field, per unit aperture area, with g = cos^m θ: m = 0 is a hard
    edge alone, larger m a vignetting lens. Directions are launched in proportion to cosθ,
    `samples` per detector and launch.
    """

    positions: Any  # Point3f, one per detector, world
    frames: Any  # Frame3f whose n is the optical axis
    radius_m: Any
    sine2: Any  # sin² of the field's half angle
    vignetting: Any  # m
    count: int
    samples: int
    rate: Any  # see `Projector`

    @classmethod
    def of(cls, view: DetectorView, samples: int) -> Self:
        """Take detectors' places in the world from their numbers."""
        frames = mi.Frame3f(mi.Vector3f(view.axes.T.astype(np.float32)))
        positions = mi.Point3f(view.positions_m.T.astype(np.float32))
        dr.make_opaque(frames, positions)
        return cls(
            positions=positions,
            frames=frames,
            radius_m=dr.opaque(mi.Float, np.sqrt(view.area_m2 / np.pi)),
            sine2=dr.opaque(mi.Float, np.sin(view.half_angle_rad) ** 2),
            vignetting=dr.opaque(mi.Float, view.vignetting),
            count=len(view.positions_m),
            samples=samples,
            rate=dr.opaque(mi.Float, samples),
        )

    @property
    def lanes(self) -> int:
        return self.count * self.samples

    @property
    def paths(self) -> Any:
        """Paths of a launch."""
        return self.count * self.rate

    def cell(self, lane: Any) -> Any:
        return lane % self.count

    def launch(self, lane: Any, sampler: Any) -> Launch:
        place = stratified(lane // self.count, self.samples, sampler)
        ray, cosine = self._ray(lane % self.count, place, sampler)
        return Launch(
            origin=ray.o,
            direction=ray.d,
            beta=self._launched(cosine),
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            state=self._density(cosine),
            cell=self._launch_cell(lane),
        )

    def pencil(self, lane: Any, sampler: Any) -> tuple[Any, Any]:
        """A ray in the field of the lane's detector, and its weight."""
        ray, cosine = self._ray(lane % self.count, sampler.next_2d(), sampler)
        return ray, self._launched(cosine)

    def _ray(self, number: Any, place: Any, sampler: Any) -> tuple[Any, Any]:
        """From the aperture in the direction of a point of the unit square; cosine to the axis."""
        frame = self._frame(number)
        disc = mi.warp.square_to_uniform_disk_concentric(place) * dr.sqrt(self.sine2)
        cosine = dr.safe_sqrt(1 - dr.squared_norm(disc))
        origin = self._aperture_point(number, frame, sampler)
        return mi.Ray3f(origin, frame.to_world(mi.Vector3f(disc.x, disc.y, cosine))), cosine

    def _launched(self, cosine: Any) -> Any:
        """Weight of a path that is launched."""
        return dr.pi * self.sine2 / self.rate * self._response(cosine)

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        return launch.state

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        return self.connect_to(self.choose(lane, sampler), vertex, sampler)

    @property
    def choices(self) -> int:
        """Among how many detectors `choose` draws one."""
        return 1

    def choose(self, lane: Any, sampler: Any) -> Any:
        """Number of the detector that the lane's path is connected to."""
        return lane % self.count

    def _launch_cell(self, lane: Any) -> Any:
        return self.cell(lane)

    def connect_to(self, number: Any, vertex: Any, sampler: Any) -> Connection:
        """The detector that was chosen, as seen from a vertex."""
        frame = self._frame(number)
        point = self._aperture_point(number, frame, sampler)
        towards = mi.Vector3f(vertex - point)
        squared = dr.squared_norm(towards)
        cosine = dr.dot(frame.n, towards) * dr.rsqrt(squared)
        inside = (cosine > 0) & (1 - cosine * cosine <= self.sine2)
        seen = dr.select(inside, cosine / squared, 0)
        return Connection(
            point=point,
            importance=seen * self._response(cosine) * self.choices,
            density=self._density(seen),
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            cell=None,
        )

    def overlap(self, number: Any, ray: Any, reach: Any) -> tuple[Any, Any]:
        """Part (near, far) of a ray that may lie in the field of a detector.

        Exact for a beam that stays in the field once it has entered, as laser and detector
        pointing the same way do; otherwise the whole of the ray. The aperture counts as widened
        by its radius, which moves the entry closer.
        """
        axis = self._frame(number).n
        apex = dr.gather(mi.Point3f, self.positions, number)
        apex -= axis * (self.radius_m * dr.safe_sqrt(1 - self.sine2) / dr.sqrt(self.sine2))
        offset = ray.o - apex
        cosine2 = 1 - self.sine2
        along, ahead = dr.dot(axis, ray.d), dr.dot(axis, offset)
        a = along * along - cosine2
        b = along * ahead - cosine2 * dr.dot(offset, ray.d)
        c = ahead * ahead - cosine2 * dr.squared_norm(offset)
        entry = (dr.safe_sqrt(b * b - a * c) - b) / a
        near = dr.select((a > 0) & (along > 0), dr.clip(entry, 0, reach), 0)
        return near, reach

    def _density(self, cosine: Any) -> Any:
        return cosine * (self.choices * dr.inv_pi) * self.rate / self.sine2

    def _response(self, cosine: Any) -> Any:
        return dr.power(dr.maximum(cosine, 1e-6), self.vignetting)

    def _frame(self, number: Any) -> Any:
        return dr.gather(mi.Frame3f, self.frames, number)

    def _aperture_point(self, number: Any, frame: Any, sampler: Any) -> Any:
        disc = mi.warp.square_to_uniform_disk_concentric(sampler.next_2d()) * self.radius_m
        centre = dr.gather(mi.Point3f, self.positions, number)
        return centre + frame.to_world(mi.Vector3f(disc.x, disc.y, 0))


class JointDetectors(Detectors):
    """Detectors whose light adds up: a path may end in any of them.

    Paths start from all in turn and are connected to one at random. Densities are per aperture
    area of all together, which is the same factor for those that start and those that end here.
    """

    @property
    def choices(self) -> int:
        return self.count

    def choose(self, lane: Any, sampler: Any) -> Any:
        if self.count == 1:
            return mi.UInt32(0)
        return dr.minimum(mi.UInt32(sampler.next_1d() * self.count), self.count - 1)

    def _launch_cell(self, lane: Any) -> Any:
        return None


def stratified(index: Any, count: int, sampler: Any) -> Any:
    """Jittered point of the unit square in stratum `index` of a grid of `count` strata."""
    across = next(side for side in range(int(np.sqrt(count)), 0, -1) if count % side == 0)
    rows, columns = (dr.opaque(mi.UInt32, side) for side in (across, count // across))
    jitter = sampler.next_2d()
    return mi.Point2f(
        (mi.Float(index % columns) + jitter.x) / columns,
        (mi.Float(index // columns % rows) + jitter.y) / rows,
    )
