"""Random walks through surfaces and fog: three strategies for multiply scattered light.

* **P** walks from the projector and joins every vertex to the detector.
* **D** walks from the detector and joins every vertex to the projector.
* The **bridge** goes along with D and joins every vertex to a fog point on a ray of the projector
  (`rays`). P and D sample a path badly if its first vertex is close to the projector and its last
  close to the detector, because each end's connection meets a 1/d². The bridge builds such paths.

A walk repeats three steps: fly to the next vertex, join it, turn. A contribution is weighted by how
densely each strategy would have built its path (`walk_state`).

Surfaces that let light pass straight on (panes, holes in a mask) are no vertices: a segment runs
through them and is attenuated, as in fog.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.beams import Beams
from spisim.transport.engine.double_scattering import estimated_along_rays
from spisim.transport.engine.ends import Connection, Launch, Projector
from spisim.transport.engine.footprint import Footprint
from spisim.transport.engine.lights import Lamp, Sun
from spisim.transport.engine.line_of_sight import Mirrored
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.tally import Contribution, Deposit, carries_light
from spisim.transport.engine.vertex import Lobe, Turn, Vertex
from spisim.transport.engine.walk_state import Ratio, WalkState, quotient
from spisim.transport.engine.weights import Weight
from spisim.transport.geometry import direction_to
from spisim.transport.jit import Bool, Float, Sampler, UInt, Vector
from spisim.transport.mirrors import Mirrors
from spisim.transport.scores import Scored, together
from spisim.transport.world import World

#: Longer paths carry nothing worth following; roulette ends almost all of them earlier.
MAX_VERTICES = 8192

#: Ends that launch paths, and ends that paths are connected to.
Source = Projector | Lamp | Beams | Detectors
Sink = Source | Sun
#: Radiance from outside the scene, by direction of the leaving path.
Sky = Callable[[Vector], Float]


class _Join(NamedTuple):
    """A vertex joined to a point."""

    end: Connection
    light: Scored  # along this path, unweighted; with the scores from the vertex on to the point
    ratio: Ratio  # R
    lobe: Lobe
    gap_m: Float
    known: Float  # closed-form factors of the transmittance of the gap
    active: Bool


@dataclass(frozen=True, eq=False)
class Walk:
    """Paths from `this` end, each vertex of which is joined to the `other`.

    `outward` paths start at an emitter, the others at a sensor. With `rays` the bridge takes part,
    carried out by the walk from the detector. `mirrors`, for outward walks, show the other end to
    paths that met a mirror first. With a `sky`, paths that leave the scene collect its light.
    """

    world: World
    this: Source
    other: Sink
    outward: bool
    weight: Weight
    deposit: Deposit
    rays: FogRays | None = None
    mirrors: Mirrors | None = None
    footprint: Footprint | None = None
    double_scattering: bool = False  # leave to `double_scattering_light` what it covers
    sky: Sky | None = None
    ending: float = 1.0  # roulette may end paths that carry less than this fraction of their start
    replicas: int = 1  # independent estimates, among which paths are dealt out

    @dr.syntax
    def run(self, seed: int, max_vertices: int = MAX_VERTICES) -> None:
        """Launch one path per lane and deposit what each vertex sends to the other end."""
        number, sampler = lanes_and_sampler(self.replicas * self.this.lanes, seed)
        replicas = dr.opaque(mi.UInt32, self.replicas)
        lane, replica = number // replicas, number % replicas
        launch = self.this.launch(lane, sampler)._replace(replica=replica)
        limit = dr.opaque(mi.UInt32, max_vertices) + launch.crossings
        path, scale = WalkState.start(launch, limit, self.world.tracked.none), 1 / launch.beta
        while dr.hint(path.active, exclude=[self, launch, scale, limit]):
            here = self._fly(path, launch, sampler)
            self._join_other_end(here, path, launch, lane, sampler)
            if dr.hint(self.mirrors is not None, mode="scalar"):
                self._join_by_mirror(here, path, launch, lane, sampler)
            if dr.hint(self.rays is not None and not self.outward, mode="scalar"):
                self._join_ray(here, path, launch, limit, sampler)
            if dr.hint(self.footprint is not None, mode="scalar"):
                self._join_footprint(here, path, launch, limit, sampler)
            turn = here.turn(sampler.next_1d(path.active), sampler.next_2d(path.active))
            self._leave(here, turn, path)
            path.roulette(turn, scale, self.ending, limit, sampler)

    def _fly(self, path: WalkState, launch: Launch, sampler: Sampler) -> Vertex:
        """Follow the ray to a surface or a collision; paths that meet neither end here."""
        media, ray = self.world.media, path.ray
        si = self.world.geometry.scene.ray_intersect(ray, path.active)
        left_m = dr.select(path.vertex == 1, path.densities.segment_m, dr.inf)
        collision = media.flight(ray, si.t, sampler, path.active, left_m)
        in_fog = path.active & (collision.distance < si.t)
        on_surface = path.active & ~in_fog & si.is_valid()
        distance = dr.select(in_fog, collision.distance, si.t)
        biased = media.flight_density(ray, distance, collision.medium, in_fog, left_m)
        path.beta *= dr.rcp(biased)
        path.scores = together(
            path.scores, self.world.tracked.along(ray, distance, sampler, path.active)
        )
        if self.sky is not None:
            escaped = path.active & ~in_fog & ~on_surface
            light = path.beta * self.sky(ray.d)
            reached = (launch.cell, path.length_m, path.scatterings)
            self.deposit(Contribution(light, *reached, escaped, launch.replica, path.scores))
        path.active &= in_fog | on_surface
        distance = dr.select(path.active, distance, 0)
        point = mi.Point3f(ray(distance))
        path.length_m += distance
        path.scatterings += dr.select(in_fog, 1, 0)
        path.beta *= dr.select(in_fog, media.albedo(collision.medium), 1)
        given = media.closed_form_transmittance(ray, distance)
        path.densities.go(distance, given * dr.select(path.active, biased, 1))
        path.densities.arrive_first(path.vertex == 1, self.this.density(launch, point))
        mode = mi.TransportMode.Importance if self.outward else mi.TransportMode.Radiance
        return Vertex(
            self.world,
            mi.BSDFContext(mode),
            si,
            collision.medium,
            point,
            ray.d,
            in_fog,
            on_surface,
        )

    def _join_other_end(
        self, here: Vertex, path: WalkState, launch: Launch, lane: UInt, sampler: Sampler
    ) -> None:
        """P or D: deposit what a vertex sends to the other end."""
        end = self._flown(self.other.connect(lane, here.point, sampler), here)
        has_part = path.active & self.weight.part(path.vertex, path.crossings > 0)
        if self.double_scattering:
            has_part &= ~self._double_scattering(here, end, path, launch)
        join = self._join(here, end, path, has_part, sampler)
        others = join.ratio.value
        if self.rays is not None and self.outward:
            start = mi.Ray3f(launch.origin, launch.direction)
            others += path.densities.bridge_outward(
                self.rays, start, here.point, join.lobe, join.ratio, path.vertex == 2
            )
        elif self.rays is not None:
            others += path.densities.bridge_inward(self.rays, end.point, here.point, here.in_fog)
        elif self.footprint is not None:
            others = path.densities.footprint(self.footprint.density(end) * join.lobe.cosines)
        self._deposit_join(join, others, path.vertex, launch, path)

    def _double_scattering(
        self, here: Vertex, end: Connection, path: WalkState, launch: Launch
    ) -> Bool:
        """Whether `double_scattering_light` adds the light of a vertex joined to the other end."""
        begun = isinstance(self.this, Beams)  # paths from beams start at their first vertex
        if self.outward:
            result = estimated_along_rays(path.densities.before, here.point, end.point, here.in_fog)
            scatterings, vertices = path.scatterings, path.vertex + (1 if begun else 0)
        elif isinstance(self.other, Beams):
            result = estimated_along_rays(end.point, here.point, launch.origin, here.in_fog)
            scatterings, vertices = path.scatterings + end.scatterings, path.vertex + 1
        else:
            result = estimated_along_rays(
                here.point, path.densities.before, launch.origin, ~here.in_fog
            )
            scatterings, vertices = path.scatterings, path.vertex
        return result & ~path.densities.met_mirror_first & (vertices == 2) & (scatterings == 1)

    def _flown(self, end: Connection, here: Vertex) -> Connection:
        """The other end, with its density multiplied by the bias of its first flights."""
        away, gap = direction_to(end.point, here.point)
        biased = self.world.media.flight_density(
            mi.Ray3f(end.point, away), gap, here.medium, here.in_fog, mi.Float(0)
        )
        return end._replace(density=end.density * biased)

    def _join_ray(
        self, here: Vertex, path: WalkState, launch: Launch, limit: UInt, sampler: Sampler
    ) -> None:
        """The bridge: deposit what a vertex sends on to a point of a ray."""
        assert self.rays is not None
        end, density = self.rays.connect(here.point, sampler, path.active)
        has_part = path.active & (path.vertex < limit)
        if self.double_scattering:
            has_part &= here.in_fog | (path.vertex > 1)
        join = self._join(here, end, path, has_part, sampler)
        detectors = quotient(join.lobe.forward * join.known, density * join.gap_m * join.gap_m)
        self._deposit_join(join, join.ratio.value + detectors, path.vertex + 1, launch, path)

    def _join_footprint(
        self, here: Vertex, path: WalkState, launch: Launch, limit: UInt, sampler: Sampler
    ) -> None:
        """Deposit what a vertex sends to a surface point that the other end sees."""
        assert self.footprint is not None
        end, density = self.footprint.connect(here.point, sampler, path.active)
        join = self._join(here, end, path, path.active & (path.vertex < limit), sampler)
        walk = quotient(join.lobe.forward, density)
        self._deposit_join(join, walk, path.vertex + 1, launch, path)

    @dr.syntax
    def _join_by_mirror(
        self, here: Vertex, path: WalkState, launch: Launch, lane: UInt, sampler: Sampler
    ) -> None:
        """Paths that met a mirror first: deposit what goes to the other end's images in mirrors."""
        mirrors = self.mirrors
        assert mirrors is not None
        assert isinstance(self.other, Detectors | Lamp)
        blind = path.active & path.densities.met_mirror_first
        number = self.other.choose(lane, sampler)
        each, count = mi.UInt32(0), dr.select(blind, mirrors.largest.count, 0)
        while dr.hint(each < count, exclude=[self, here, path, launch, mirrors, number, count]):
            view = Mirrored(self.world, self.other, mirrors.one(each))
            end = view.connect_to(number, here.point, sampler)
            visible = mirrors.largest.shows(each, here.point, end.point) & (end.importance > 0)
            if dr.hint(visible, exclude=[self, here, path, launch, view, end]):
                self._deposit_mirrored(here, path, launch, view, end, sampler, mi.Bool(True))
            each += 1
        if dr.hint(mirrors.maximum > 1, mode="scalar"):
            fold, looked = mirrors.choose_two(sampler)
            view = Mirrored(self.world, self.other, fold)
            end = view.connect_to(number, here.point, sampler)
            self._deposit_mirrored(here, path, launch, view, end, sampler, blind & looked)

    def _deposit_mirrored(
        self,
        here: Vertex,
        path: WalkState,
        launch: Launch,
        view: Mirrored,
        end: Connection,
        sampler: Sampler,
        active: Bool,
    ) -> None:
        towards, length_m = direction_to(here.point, end.point)
        lobe = here.lobe(towards, active & (end.importance > 0))
        light = Scored(path.beta * end.importance * lobe.value, lobe.scores)
        lit = active & carries_light(light.value)
        light *= view.transmission(
            here.si, here.point, towards, length_m, here.in_fog, sampler, lit
        )
        self._deposit(light, end, length_m, lit & carries_light(light.value), launch, path)

    def _join(
        self, here: Vertex, end: Connection, path: WalkState, allowed: Bool, sampler: Sampler
    ) -> _Join:
        towards, gap = direction_to(here.point, end.point)
        lobe = here.lobe(towards, path.active & (end.importance > 0))
        light = Scored(path.beta * end.importance * lobe.value, lobe.scores)
        connected = allowed & carries_light(light.value)
        light *= here.transmission(towards, gap, sampler, connected)
        given = self.world.media.closed_form_transmittance(mi.Ray3f(here.point, towards), gap)
        ratio = path.densities.other_end(lobe, end, given, path.vertex == 1)
        return _Join(end, light, ratio, lobe, gap, given, connected & carries_light(light.value))

    def _deposit_join(
        self, join: _Join, others: Float, vertex: UInt, launch: Launch, path: WalkState
    ) -> None:
        light = join.light * self.weight.fraction(others, vertex)
        self._deposit(light, join.end, join.gap_m, join.active, launch, path)

    def _deposit(
        self, light: Scored, end: Connection, gap: Float, lit: Bool, launch: Launch, path: WalkState
    ) -> None:
        cell = end.cell if launch.cell is None else launch.cell
        length_m = path.length_m + gap + end.length_m
        scatterings = path.scatterings + end.scatterings
        reached = (cell, length_m, scatterings, lit, launch.replica)
        scores = together(path.scores, light.scores, end.scores)
        self.deposit(Contribution(light.value, *reached, scores))

    def _leave(self, here: Vertex, turn: Turn, path: WalkState) -> None:
        """Take the next direction."""
        path.beta *= turn.weight
        path.scores = together(path.scores, turn.scores)
        path.densities.leave(turn, here.in_fog, path.vertex == 1)
        if self.rays is not None:
            allowed = here.in_fog if self.outward else ~turn.specular
            path.densities.settle_bridge(turn, here.point, path.vertex == 2, allowed)
        elif self.footprint is not None:
            path.densities.before_forward = turn.forward
        path.follow(turn)


def lanes_and_sampler(count: int, seed: int) -> tuple[UInt, Sampler]:
    """Lane indices and a sampler for them."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, seed), count)
    return dr.arange(mi.UInt32, count), sampler
