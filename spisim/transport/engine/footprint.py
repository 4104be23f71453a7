"""In clear air: a projector's walk, connected to a surface that a detector sees.

A walk rarely meets what a narrow field covers. Its vertices are therefore also joined to the points
that random rays of the detectors meet. Only close to these points does the walk itself arrive more
often.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.apertures import JointDetectors
from spisim.transport.engine.ends import Connection
from spisim.transport.engine.lights import Lamp
from spisim.transport.geometry import direction_to
from spisim.transport.jit import Bool, Float, Point, Sampler
from spisim.transport.world import World


@dataclass(frozen=True, eq=False)
class Footprint:
    """First surfaces on random paths that leave an end."""

    world: World
    end: JointDetectors | Lamp

    def connect(self, vertex: Point, sampler: Sampler, active: Bool) -> tuple[Connection, Float]:
        """A surface point joined to `vertex`; its density per area, over cosine / distance²."""
        number = dr.minimum(sampler.next_1d() * self.end.paths, self.end.paths - 1)
        lane = mi.UInt32(number)
        launch = self.end.launch(lane, sampler)
        si = self.world.geometry.scene.ray_intersect(
            mi.Ray3f(launch.origin, launch.direction), active
        )
        towards, gap = direction_to(si.p, vertex)
        context = mi.BSDFContext(mi.TransportMode.Radiance)
        reflected = self.world.reflected(context, si, towards, active & si.is_valid())
        launched = self.end.density(launch, si.p) / self.end.paths
        end = Connection(
            point=si.p,
            importance=launch.beta * self.end.paths * reflected.value / (gap * gap),
            density=mi.Float(0),
            length_m=si.t,
            scatterings=mi.UInt32(0),
            cell=launch.cell,
            scores=reflected.scores,
        )
        leaving = dr.abs(si.to_local(towards).z)
        cosines = dr.abs(si.wi.z) / dr.maximum(leaving, 1e-7)
        return end, launched * cosines * dr.square(gap / si.t)

    def density(self, end: Connection) -> Float:
        """Number density / distance² of picking the vertex from which `end` is seen."""
        return end.density / self.end.paths
