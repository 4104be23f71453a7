"""Lights that detectors receive as a whole: what a projector shows on average, and the sun."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.transport.engine.ends import Connection, Launch, Projector, RandomRay, stratified
from spisim.transport.views import ProjectorView


@dataclass(frozen=True, eq=False)
class Lamp:
    """A projector that shows one picture and emits unit power.

    Paths are launched uniformly over the image plane: `samples` per launch for each of the `cells`,
    the detectors, of which the lane tells the number, as it does in `Detectors`.
    """

    projector: Projector
    shares: Any  # of the power, by virtual pixel
    cells: int
    samples: int
    rate: Any  # see `Projector`

    @classmethod
    def of(
        cls, view: ProjectorView, power: NDArray[np.floating[Any]], cells: int = 1, samples: int = 1
    ) -> Lamp:
        """`power` (H, W) of each virtual pixel, in any unit."""
        total = max(float(power.sum()), float(np.finfo(np.float64).tiny))
        shares = mi.Float((power / total).astype(np.float32).ravel())
        dr.make_opaque(shares)
        return cls(Projector.of(view, 1), shares, cells, samples, dr.opaque(mi.Float, samples))

    @property
    def lanes(self) -> int:
        return self.cells * self.samples

    @property
    def paths(self) -> Any:
        """Paths of a launch that may reach one and the same detector."""
        return self.rate

    def launch(self, lane: Any, sampler: Any) -> Launch:
        place = stratified(lane // self.cells, self.samples, sampler)
        ray, weight = self._ray(place, sampler)
        return Launch(
            origin=ray.o,
            direction=ray.d,
            beta=weight / self.rate,
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            state=self.projector.importance_of(ray.d) * (self.rate / self.projector.pixels),
            cell=lane % self.cells,
        )

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        return launch.state

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        end = self.projector.connect(lane, vertex, sampler)
        share = dr.gather(mi.Float, self.shares, end.cell)
        return end._replace(
            importance=end.importance * share,
            density=end.importance * (self.rate / self.projector.pixels),
            cell=None,
        )

    def random_ray(self, sampler: Any) -> RandomRay:
        """A ray through a random point of the field."""
        return RandomRay(*self._ray(sampler.next_2d(), sampler), None)

    def random_ray_density(self, direction: Any, lens: Any) -> Any:
        """See `Projector`."""
        return self.projector.random_ray_density(direction, lens)

    def choose(self, lane: Any, sampler: Any) -> Any:
        """There is one lamp for all lanes."""
        return lane

    def connect_to(self, number: Any, vertex: Any, sampler: Any) -> Connection:
        """See `connect`."""
        return self.connect(number, vertex, sampler)

    def overlap(self, number: Any, ray: Any, reach: Any) -> tuple[Any, Any]:
        """Part (near, far) of a ray that lies in the field."""
        return self.projector.overlap(ray, reach)

    def _ray(self, place: Any, sampler: Any) -> tuple[Any, Any]:
        ray, pixel = self.projector.ray_at(place, sampler)
        return ray, dr.gather(mi.Float, self.shares, pixel) * self.projector.pixels


@dataclass(frozen=True, eq=False)
class Sun:
    """Parallel light; paths end in it, and are never launched from it.

    It is nowhere close, so that paths of the other side alone have a finite variance.
    """

    irradiance: Any  # W/m² on a surface that faces it
    direction: Any  # from the sun, unit
    distance_m: Any  # further than anything in the scene

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        return Connection(
            point=vertex - self.direction * self.distance_m,
            importance=mi.Float(self.irradiance),
            density=mi.Float(0),
            length_m=mi.Float(0),
            scatterings=mi.UInt32(0),
            cell=None,
        )
