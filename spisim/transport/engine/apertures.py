"""Detectors as ends of light paths; see `ends`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.transport.engine.ends import Connection, Launch, stratified
from spisim.transport.jit import Float, Frame, Point, Point2, Ray, Sampler, UInt
from spisim.transport.views import DetectorView


@dataclass(frozen=True, eq=False)
class Detectors:
    """Disc apertures with a conical field of view; every lane has its own one.

    W(ω) = g(θ) cosθ inside the field, per unit aperture area, with g = cos^m θ: m = 0 is a hard
    edge alone, larger m a vignetting lens. Directions are launched in proportion to cosθ,
    `samples` per detector and launch.
    """

    positions: Point  # Point3f, one per detector, world
    frames: Frame  # Frame3f whose n is the optical axis
    radius_m: Float
    sine2: Float  # sin² of the field's half angle
    vignetting: Float  # m
    count: int
    samples: int
    samples_jit: Float  # see `Projector`

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
            samples_jit=dr.opaque(mi.Float, samples),
        )

    @property
    def lanes(self) -> int:
        return self.count * self.samples

    @property
    def paths(self) -> Float:
        """Paths of a launch."""
        return self.count * self.samples_jit

    def cell(self, lane: UInt) -> UInt:
        return lane % self.count

    def launch(self, lane: UInt, sampler: Sampler) -> Launch:
        square = stratified(lane // self.count, self.samples, sampler)
        ray, cosine = self._ray(lane % self.count, square, sampler)
        return Launch(
            origin=ray.o,
            direction=ray.d,
            beta=self._launched(cosine),
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            state=self._density(cosine),
            cell=self._launch_cell(lane),
        )

    def pencil(self, lane: UInt, sampler: Sampler) -> tuple[Ray, Float]:
        """A ray in the field of the lane's detector, and its weight."""
        ray, cosine = self._ray(lane % self.count, sampler.next_2d(), sampler)
        return ray, self._launched(cosine)

    def _ray(self, number: UInt, square: Point2, sampler: Sampler) -> tuple[Ray, Float]:
        """From the aperture in the direction of a point of the unit square; cosine to the axis."""
        frame = self._frame(number)
        disc = mi.warp.square_to_uniform_disk_concentric(square) * dr.sqrt(self.sine2)
        cosine = dr.safe_sqrt(1 - dr.squared_norm(disc))
        origin = self._aperture_point(number, frame, sampler)
        return mi.Ray3f(origin, frame.to_world(mi.Vector3f(disc.x, disc.y, cosine))), cosine

    def _launched(self, cosine: Float) -> Float:
        """Weight of a path that is launched."""
        return dr.pi * self.sine2 / self.samples_jit * self._response(cosine)

    def density(self, launch: Launch, first_vertex: Point) -> Float:
        return launch.state

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        return self.connect_to(self.choose(lane, sampler), vertex, sampler)

    @property
    def choices(self) -> int:
        """Among how many detectors `choose` draws one."""
        return 1

    def choose(self, lane: UInt, sampler: Sampler) -> UInt:
        """Number of the detector that the lane's path is connected to."""
        return lane % self.count

    def _launch_cell(self, lane: UInt) -> UInt | None:
        return self.cell(lane)

    def connect_to(self, number: UInt, vertex: Point, sampler: Sampler) -> Connection:
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

    def overlap(self, number: UInt, ray: Ray, far: Float) -> tuple[Float, Float]:
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
        near = dr.select((a > 0) & (along > 0), dr.clip(entry, 0, far), 0)
        return near, far

    def _density(self, cosine: Float) -> Float:
        return cosine * (self.choices * dr.inv_pi) * self.samples_jit / self.sine2

    def _response(self, cosine: Float) -> Float:
        return dr.power(dr.maximum(cosine, 1e-6), self.vignetting)

    def _frame(self, number: UInt) -> Frame:
        return dr.gather(mi.Frame3f, self.frames, number)

    def _aperture_point(self, number: UInt, frame: Frame, sampler: Sampler) -> Point:
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

    def choose(self, lane: UInt, sampler: Sampler) -> UInt:
        if self.count == 1:
            return mi.UInt32(0)
        return dr.minimum(mi.UInt32(sampler.next_1d() * self.count), self.count - 1)

    def _launch_cell(self, lane: UInt) -> UInt | None:
        return None
