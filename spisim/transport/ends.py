"""The two ends of every path: the projector's pinhole and the detectors' apertures.

An end is described by its importance W(ω): a path p → x₁ → … → xₙ → y carries the fraction

    W_P(ω₀) · Π (scattering · transmittance / distance²) · W_D(ωₙ)

of the emitted power onto unit detector area. Paths are launched from an end in proportion to its
W, so that (number of paths) x (density of a direction) = κ W with one constant κ per end. Seen
like this both ends are alike, and one walk serves either.

Every end offers `launch`, which starts paths; `density`, the number density κ W (1/sr) with which
it did; and `connect`, where a path of the other side may end.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.transport.views import DetectorView, ProjectorView


class Launch(NamedTuple):
    """Paths that leave an end: where, whereto, and 1/κ."""

    origin: Any
    direction: Any
    beta: Any
    length_m: Any  # optical path from the emitter to `origin`
    state: Any  # what `density` needs to know
    cell: Any  # accumulator cell of the emitter, None where this end is a detector


class Connection(NamedTuple):
    """The end seen from a path vertex."""

    point: Any  # where the path ends
    importance: Any  # W towards the vertex; 0 where the end does not look
    density: Any  # κ W: how densely this end itself launches paths that way (1/sr)
    length_m: Any  # optical path from `point` on to the emitter
    cell: Any  # accumulator cell of the emitter, None where this end is a detector


@dataclass(frozen=True, eq=False)
class Projector:
    """Pinhole whose virtual pixels emit unit power each, uniform over their image-plane area.

    W(ω) = 1 / (a_u cos³θ), with a_u the area of pixel u on the image plane at unit distance.
    A chunk launches `samples` paths per pixel, so κ = samples.
    """

    to_world: Any
    to_optical: Any
    shape: tuple[int, int]
    half_width: Any
    half_height: Any
    samples: int

    @classmethod
    def of(cls, view: ProjectorView, samples: int) -> Projector:
        """`samples` paths per virtual pixel and launch."""
        return cls(
            to_world=_transform(view.pose),
            to_optical=_transform(np.linalg.inv(view.pose)),
            shape=view.shape,
            half_width=dr.opaque(mi.Float, view.tan_half_width),
            half_height=dr.opaque(mi.Float, view.tan_half_height),
            samples=samples,
        )

    @property
    def pixels(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def lanes(self) -> int:
        return self.pixels * self.samples

    def launch(self, lane: Any, sampler: Any) -> Launch:
        cell = lane % self.pixels
        height, width = self.shape
        jitter = _stratified(lane // self.pixels, self.samples, sampler)
        x = (2 * (mi.Float(cell % width) + jitter.x) / width - 1) * self.half_width
        y = (2 * (mi.Float(cell // width) + jitter.y) / height - 1) * self.half_height
        local = dr.normalize(mi.Vector3f(x, y, 1))
        density = self.samples * self._importance(local.z)
        beta = mi.Float(1 / self.samples)
        return Launch(self._pinhole(), self.to_world @ local, beta, mi.Float(0), density, cell)

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        return launch.state

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        local = self.to_optical @ vertex
        height, width = self.shape
        u = (local.x / (local.z * self.half_width) + 1) * (0.5 * width)
        v = (local.y / (local.z * self.half_height) + 1) * (0.5 * height)
        inside = (local.z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        importance = dr.select(inside, self._importance(local.z * dr.rcp(dr.norm(local))), 0)
        cell = dr.select(inside, mi.UInt32(v) * width + mi.UInt32(u), 0)
        return Connection(self._pinhole(), importance, self.samples * importance, mi.Float(0), cell)

    def _pinhole(self) -> Any:
        return self.to_world @ mi.Point3f(0, 0, 0)

    def _importance(self, cosine: Any) -> Any:
        pixel_area = 4 * self.half_width * self.half_height / self.pixels
        return dr.rcp(pixel_area * cosine**3)


@dataclass(frozen=True, eq=False)
class Detectors:
    """Disc apertures with a hard conical field of view, one per accumulator row.

    W(ω) = cosθ inside the field, per unit aperture area. Directions are launched in proportion
    to cosθ: κ = samples / (π sin²(half angle)).
    """

    positions: Any  # Point3f, one per detector, world
    frames: Any  # Frame3f whose n is the optical axis
    radius_m: Any
    sine2: Any  # sin² of the field's half angle
    count: int
    samples: int  # paths launched per detector and chunk

    @classmethod
    def of(cls, view: DetectorView, samples: int) -> Detectors:
        """`samples` paths per detector and launch."""
        frames = mi.Frame3f(mi.Vector3f(view.axes.T.astype(np.float32)))
        positions = mi.Point3f(view.positions_m.T.astype(np.float32))
        dr.make_opaque(frames, positions)
        return cls(
            positions=positions,
            frames=frames,
            radius_m=dr.opaque(mi.Float, np.sqrt(view.area_m2 / np.pi)),
            sine2=dr.opaque(mi.Float, np.sin(view.half_angle_rad) ** 2),
            count=len(view.positions_m),
            samples=samples,
        )

    @property
    def lanes(self) -> int:
        return self.count * self.samples

    def launch(self, lane: Any, sampler: Any) -> Launch:
        frame = self._frame(lane)
        disc = mi.warp.square_to_uniform_disk_concentric(
            _stratified(lane // self.count, self.samples, sampler)
        ) * dr.sqrt(self.sine2)
        z = dr.safe_sqrt(1 - dr.squared_norm(disc))
        return Launch(
            self._aperture_point(lane, frame, sampler),
            frame.to_world(mi.Vector3f(disc.x, disc.y, z)),
            mi.Float(dr.pi * self.sine2 / self.samples),
            mi.Float(0),
            self._density(z),
            None,
        )

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        return launch.state

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        frame = self._frame(lane)
        point = self._aperture_point(lane, frame, sampler)
        cosine = dr.dot(frame.n, dr.normalize(vertex - point))
        inside = (cosine > 0) & (1 - cosine * cosine <= self.sine2)
        importance = dr.select(inside, cosine, 0)
        return Connection(point, importance, self._density(importance), mi.Float(0), None)

    def _density(self, importance: Any) -> Any:
        return importance * (self.samples * dr.inv_pi) / self.sine2

    def overlap(self, lane: Any, ray: Any, reach: Any) -> tuple[Any, Any]:
        """Part (near, far) of a ray that may lie in the field of the lane's detector.

        Exact for a beam that stays in the field once it has entered, as laser and detector
        pointing the same way do; otherwise the whole of the ray. The aperture counts as widened
        by its radius, which moves the entry closer.
        """
        axis = self._frame(lane).n
        apex = dr.gather(mi.Point3f, self.positions, lane % self.count)
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

    def _frame(self, lane: Any) -> Any:
        return dr.gather(mi.Frame3f, self.frames, lane % self.count)

    def _aperture_point(self, lane: Any, frame: Any, sampler: Any) -> Any:
        disc = mi.warp.square_to_uniform_disk_concentric(sampler.next_2d()) * self.radius_m
        centre = dr.gather(mi.Point3f, self.positions, lane % self.count)
        return centre + frame.to_world(mi.Vector3f(disc.x, disc.y, 0))


def _transform(matrix: NDArray[np.floating[Any]]) -> Any:
    transform = mi.Transform4f(mi.Matrix4f(matrix.astype(np.float32)))
    dr.make_opaque(transform)
    return transform


def _stratified(index: Any, count: int, sampler: Any) -> Any:
    """Jittered point of the unit square in stratum `index` of the largest square grid ≤ count."""
    side = int(np.sqrt(count))
    grid = mi.Point2f(mi.Float(index % side), mi.Float((index // side) % side))
    strata = index < side * side
    jitter = sampler.next_2d()
    return dr.select(strata, (grid + jitter) / side, jitter)
