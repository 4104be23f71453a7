"""Lights that detectors receive as a whole: a projector's mean picture, and the sun."""

from dataclasses import dataclass
from typing import Self

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument.views import ProjectorView
from spisim.transport.engine.ends import Connection, Launch, Projector, RandomRay
from spisim.transport.jit import Float, Object, Point, Ray, Sampler, UInt, Vector


@dataclass(frozen=True, eq=False)
class Lamp:
    """A projector that displays one picture and emits unit power.

    Pixels launch paths in proportion to their brightness: `samples` per launch, or `samples` for
    each of `cells` detectors, which the lane numbers as in `Detectors`.
    """

    projector: Projector
    fractions: Float  # of the power, by virtual pixel
    pixels: Object  # mi.DiscreteDistribution of `fractions`
    samples: int
    samples_jit: Float  # see `Projector`
    cells: int | None

    @classmethod
    def of(
        cls, view: ProjectorView, power: Floats, samples: int = 1, cells: int | None = None
    ) -> Self:
        """From the power (H, W) of each virtual pixel, in any unit."""
        fractions = mi.Float((power / power.sum()).astype(np.float32).ravel())
        dr.make_opaque(fractions)
        pixels, samples_jit = mi.DiscreteDistribution(fractions), dr.opaque(mi.Float, samples)
        return cls(Projector.of(view, 1), fractions, pixels, samples, samples_jit, cells)

    @property
    def lanes(self) -> int:
        return self.samples * (self.cells or 1)

    @property
    def paths(self) -> Float:
        """Paths of a launch that may reach the same detector."""
        return self.samples_jit

    @property
    def middle(self) -> Point:
        """Centre of the lens, world."""
        return self.projector.middle

    def cell(self, lane: UInt) -> UInt:
        return None if self.cells is None else lane % self.cells

    def launch(self, lane: UInt, sampler: Sampler) -> Launch:
        index = lane // (self.cells or 1)
        pixel = self.pixels.sample((mi.Float(index) + sampler.next_1d()) / self.samples_jit)
        ray, _ = self.projector.pencil(pixel, sampler)
        importance = self.projector.importance_of(ray.d) * dr.gather(
            mi.Float, self.fractions, pixel
        )
        return Launch(
            origin=ray.o,
            direction=ray.d,
            beta=dr.rcp(self.samples_jit),
            state=importance * self.samples_jit,
            cell=self.cell(lane),
        )

    def density(self, launch: Launch, first_vertex: Point) -> Float:
        return launch.state

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        end = self.projector.connect(lane, vertex, sampler)
        importance = end.importance * dr.gather(mi.Float, self.fractions, end.cell)
        return end._replace(importance=importance, density=importance * self.samples_jit, cell=None)

    def random_ray(self, sampler: Sampler) -> RandomRay:
        """A ray through a random point of the field."""
        ray, pixel = self.projector.ray_at(sampler.next_2d(), sampler)
        weight = dr.gather(mi.Float, self.fractions, pixel) * self.projector.pixels
        return RandomRay(ray, weight, weight * self.samples_jit, None)

    def random_ray_density(self, direction: Vector, lens: Point) -> Float:
        return self.projector.random_ray_density(direction, lens)

    def choose(self, lane: UInt, sampler: Sampler) -> UInt:
        """There is one lamp for all lanes."""
        return mi.UInt32(0)

    def connect_to(self, number: UInt, vertex: Point, sampler: Sampler) -> Connection:
        return self.connect(number, vertex, sampler)

    def overlap(self, number: UInt, ray: Ray, far: Float) -> tuple[Float, Float]:
        """Part (near, far) of a ray that lies in the field."""
        return self.projector.overlap(ray, far)


@dataclass(frozen=True, eq=False)
class Sun:
    """Parallel light, never close to a vertex; paths end in it, and are never launched from it."""

    irradiance: Float  # W/m² on a surface that faces it
    direction: Vector  # from the sun, unit
    distance_m: Float  # beyond everything in the scene

    def connect(self, lane: UInt, vertex: Point, sampler: Sampler) -> Connection:
        return Connection(
            point=vertex - self.direction * self.distance_m,
            importance=mi.Float(self.irradiance),
            density=mi.Float(0),
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            cell=None,
        )
