"""Detectors as ends of light paths; see `ends`."""

from dataclasses import dataclass
from typing import Self

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.instrument.views import DetectorView
from spisim.transport.engine.ends import Connection, Launch, stratified
from spisim.transport.jit import Float, Frame, Point, Point2, Ray, Sampler, UInt


@dataclass(frozen=True, eq=False)
class Detectors:
    """Disc apertures with a conical field of view; each lane has its own detector.

    W(ω) = g(θ) cosθ inside the field, per unit aperture area, with g = cos^m θ. A hard-edged field
    has m = 0; a vignetting lens has a larger m. Directions are launched in proportion to cosθ,
    `samples` per detector and launch.
    """

    positions: Point  # one per detector, world
    frames: Frame  # n is the optical axis
    radius_m: Float
    sine2: Float  # sin² of the field's half angle
    vignetting: Float  # m
    count: int
    samples: int
    samples_jit: Float  # see `Projector`

    @classmethod
    def of(cls, view: DetectorView, samples: int) -> Self:
        """Convert a view, which holds plain numbers."""
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
        """Number of paths of a launch, as an opaque number."""
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
            state=self._density(cosine),
            cell=self._launch_cell(lane),
        )

    def pencil(self, lane: UInt, sampler: Sampler) -> tuple[Ray, Float]:
        """A ray in the field of the lane's detector, and its weight."""
        ray, cosine = self._ray(lane % self.count, sampler.next_2d(), sampler)
        return ray, self._launched(cosine)

    def _ray(self, number: UInt, square: Point2, sampler: Sampler) -> tuple[Ray, Float]:
        """Ray from the aperture towards a point of the unit square, and its cosine to the axis."""
        frame = self._frame(number)
        disc = mi.warp.square_to_uniform_disk_concentric(square) * dr.sqrt(self.sine2)
        cosine = dr.safe_sqrt(1 - dr.squared_norm(disc))
        origin = self._aperture_point(number, frame, sampler)
        return mi.Ray3f(origin, frame.to_world(mi.Vector3f(disc.x, disc.y, cosine))), cosine

    def _launched(self, cosine: Float) -> Float:
        """Weight of a launched path."""
        return dr.pi * self.sine2 / self.samples_jit * self._response(cosine)

    def density(self, launch: Launch, first_vertex: Point) -> Float:
        return launch.state

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        return self.connect_to(self.choose(lane, sampler), vertex, sampler)

    @property
    def choices(self) -> int:
        """Number of detectors among which `choose` draws one."""
        return 1

    def choose(self, lane: UInt, sampler: Sampler) -> UInt:
        """Index of the detector that the lane's path is connected to."""
        return lane % self.count

    def _launch_cell(self, lane: UInt) -> UInt | None:
        return self.cell(lane)

    def connect_to(self, number: UInt, vertex: Point, sampler: Sampler) -> Connection:
        """Detector `number`, as seen from a vertex."""
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

        Exact for a ray that stays in the field once it has entered, as with a laser and a detector
        that point the same way; otherwise the whole ray. The apex is moved back by the radius of
        the aperture, which moves the entry closer.
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

    Paths start from all detectors in turn and are connected to one at random. Densities are per
    total aperture area, which is the same factor for both kinds of paths.
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
