"""Random walk through surfaces and fog that connects every vertex to the opposite end.

The balance heuristic (Veach 1997, §9.2) needs, for each path x₁…xₙ, the ratio of the density
with which the opposite end would have built it to the density with which this end did:

    R = [κW_other / κW_this] · [d_start² / d_end²] · [Tr(d_end) / Tr(d_start)]
        · Π_{i=1..n} cout_i / cin_i · Π_{i=2..n} pr_i / Π_{i=1..n-1} pf_i

pf_i (pr_i) is the solid-angle density of leaving vertex i forwards (backwards), cin_i and cout_i
the cosines at a surface (1 in fog), d_start and d_end the first and last segment. Inner distances
and transmittances cancel, so the ratio is carried along in one number. Factors of Tr that have no
closed form are left out for all strategies alike, which keeps the weights' sum at one.

A path whose first vertex is close to the projector and whose last is close to the detector is bad
for both: each end's connection meets a 1/d². A third strategy builds it: the detector's walk down
to x₂, and x₁ on a ray that the projector sends out (`rays`). Its density relative to that of the
detector's strategy depends on the three points next to the projector alone,

    S = rays(x₀, x₁, x₂) · |x₁-x₂|² / (pr₂ · Tr(x₁,x₂))

so it costs the others' weights, 1 / (1 + R + R S) and 1 / (1 + R + S), next to nothing. R goes
with d_start², S of the projector's strategy with 1/d_start²: what is kept of them is R / d_start²
and S d_start², for a collision may lie so close to the projector that it rounds to the same point.

Surfaces that let light pass straight on (panes, holes in a mask) are no vertices: a segment runs
through them and is weakened, as in fog.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.beams import Beams
from spisim.transport.engine.ends import Connection, Detectors, Launch, Projector
from spisim.transport.engine.lights import Lamp, Sun
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.tally import Contribution, Deposit, carries_light
from spisim.transport.engine.vertex import Lobe, Turn, Vertex
from spisim.transport.engine.weights import Weight
from spisim.transport.geometry import direction_to
from spisim.transport.world import World

#: Paths longer than this carry nothing worth following; roulette ends almost all of them earlier.
MAX_VERTICES = 256
#: Russian roulette starts here; before, a path that carries little is still worth its cost.
ROULETTE_VERTEX = 5
MAX_SURVIVAL = 0.95
#: Surfaces that a path passes straight through, all in all.
MAX_CROSSINGS = 64


#: Ends that launch paths, and ends that paths are connected to.
Source = Projector | Lamp | Beams | Detectors
Sink = Source | Sun
#: Radiance from outside the scene, by direction of the leaving path.
Sky = Callable[[Any], Any]


@dataclass
class Densities:
    """What is known of R and S so far; see the head of this module."""

    ratio: Any  # Π cout / cin · Π pr / Π pf
    start: Any  # 1 / (κW_this Tr(d_start))
    start_m: Any  # d_start
    segment_m: Any
    through: Any  # Tr of the segment, as far as it has a closed form
    before: Any  # last vertex
    before_forward: Any  # density of leaving it; 0 where a third strategy has no part
    bridge: Any  # S d_start²

    @classmethod
    def start_at(cls, point: Any) -> Densities:
        """At an end."""
        return cls(
            ratio=mi.Float(1),
            start=mi.Float(0),
            start_m=mi.Float(0),
            segment_m=mi.Float(0),
            through=mi.Float(1),
            before=mi.Point3f(point),
            before_forward=mi.Float(0),
            bridge=mi.Float(0),
        )

    def over_segment(self, value: Any) -> Any:
        """`value` times the segment's length² over its transmittance."""
        return value * self.segment_m * self.segment_m / self.through


@dataclass
class Path:
    """One path per lane, on its way to vertex number `vertex`."""

    ray: Any
    beta: Any  # weight
    length_m: Any
    scatterings: Any
    vertex: Any
    crossings: Any  # surfaces passed straight through
    active: Any
    densities: Densities

    @classmethod
    def start(cls, launch: Launch) -> Path:
        """At an end."""
        beta = mi.Float(launch.beta)
        return cls(
            ray=mi.Ray3f(launch.origin, launch.direction),
            beta=beta,
            length_m=mi.Float(launch.length_m),
            scatterings=mi.UInt32(launch.scatterings),
            vertex=mi.UInt32(1),
            crossings=mi.UInt32(0),
            active=carries_light(beta),
            densities=Densities.start_at(launch.origin),
        )


class _Join(NamedTuple):
    """The connection of a vertex to an end."""

    value: Any  # of the light that comes this way, unweighted
    others: Any  # R
    others_per_m2: Any  # R / d_start²
    lobe: Lobe
    gap_m: Any
    known: Any  # transmittance of the gap, as far as it has a closed form
    active: Any


@dataclass(frozen=True, eq=False)
class Walk:
    """Paths from `this` end, each vertex of which is connected to the `other`.

    `outward` paths start at an emitter, the others at a sensor. With `rays`, the third strategy
    takes part; a walk from a detector then carries it out. With a `sky`, paths that leave the scene
    find its light.
    """

    world: World
    this: Source
    other: Sink
    outward: bool
    weight: Weight
    deposit: Deposit
    rays: FogRays | None = None
    sky: Sky | None = None

    @dr.syntax
    def run(self, seed: int, max_vertices: int = MAX_VERTICES) -> None:
        """Launch one path per lane and deposit what each vertex sends to the other end."""
        lane, sampler = lanes(self.this.lanes, seed)
        limit = dr.opaque(mi.UInt32, max_vertices)
        launch = self.this.launch(lane, sampler)
        path, scale = Path.start(launch), 1 / launch.beta
        while dr.hint(path.active, exclude=[self, launch, scale, limit]):
            here = self._arrive(path, launch, sampler)
            self._connect(here, path, launch, lane, sampler)
            if dr.hint(self.rays is not None and not self.outward, mode="scalar"):
                self._connect_to_ray(here, path, launch, limit, sampler)
            turn = here.turn(sampler.next_1d(path.active), sampler.next_2d(path.active))
            self._leave(here, turn, path)
            self._roulette(turn, path, scale, limit, sampler)

    def _arrive(self, path: Path, launch: Launch, sampler: Any) -> Vertex:
        """Follow the ray to a surface or a collision; paths that meet neither end here."""
        media, ray, densities = self.world.media, path.ray, path.densities
        si = self.world.geometry.scene.ray_intersect(ray, path.active)
        collision = media.flight(ray, si.t, sampler, path.active)
        in_fog = path.active & (collision.distance < si.t)
        on_surface = path.active & ~in_fog & si.is_valid()
        if self.sky is not None:
            escaped = path.active & ~in_fog & ~on_surface
            light = path.beta * self.sky(ray.d)
            self.deposit(Contribution(light, launch.cell, path.length_m, path.scatterings, escaped))
        path.active &= in_fog | on_surface
        distance = dr.select(in_fog, collision.distance, si.t)
        distance = dr.select(path.active, distance, 0)
        point = mi.Point3f(ray(distance))
        path.length_m += distance
        path.scatterings += dr.select(in_fog, 1, 0)
        path.beta *= dr.select(in_fog, media.albedo(collision.medium), 1)
        densities.segment_m += distance
        densities.through *= media.known_transmittance(ray.o, ray.d, distance)
        first = path.vertex == 1
        start = dr.rcp(self.this.density(launch, point) * densities.through)
        densities.start = dr.select(first, start, densities.start)
        densities.start_m = dr.select(first, densities.segment_m, densities.start_m)
        mode = mi.TransportMode.Importance if self.outward else mi.TransportMode.Radiance
        return Vertex(
            self.world.geometry,
            media,
            mi.BSDFContext(mode),
            si,
            collision.medium,
            point,
            ray.d,
            in_fog,
            on_surface,
        )

    def _connect(self, here: Vertex, path: Path, launch: Launch, lane: Any, sampler: Any) -> None:
        """Deposit what a vertex sends to the other end."""
        densities = path.densities
        end = self.other.connect(lane, here.point, sampler)
        join = self._join(here, end, path, path.active, sampler)
        others = join.others
        if self.rays is not None and self.outward:
            second = path.vertex == 2
            ray = mi.Ray3f(launch.origin, launch.direction)
            place = self.rays.density(ray, densities.start_m, here.point)
            reach = dr.select(densities.before_forward > 0, densities.over_segment(place), 0)
            densities.bridge = dr.select(second, reach, densities.bridge)
            at_second = _quotient(densities.bridge, join.lobe.backward)
            others += join.others_per_m2 * dr.select(second, at_second, densities.bridge)
        elif self.rays is not None:
            direction, gap = direction_to(end.point, here.point)
            place = self.rays.density(mi.Ray3f(end.point, direction), gap, densities.before)
            reach = _quotient(densities.over_segment(place), densities.before_forward * gap * gap)
            others += dr.select(here.in_fog, reach, 0)
        self._deposit(join, others, path.vertex, end, launch, path)

    def _connect_to_ray(
        self, here: Vertex, path: Path, launch: Launch, limit: Any, sampler: Any
    ) -> None:
        """The third strategy: deposit what a vertex sends on to a point of a ray."""
        assert self.rays is not None
        end, place = self.rays.connect(here.point, sampler, path.active)
        allowed = path.active & (path.vertex < limit)
        join = self._join(here, end, path, allowed, sampler)
        towards = _quotient(join.lobe.forward * join.known, place * join.gap_m * join.gap_m)
        self._deposit(join, join.others + towards, path.vertex + 1, end, launch, path)

    def _join(self, here: Vertex, end: Connection, path: Path, allowed: Any, sampler: Any) -> _Join:
        densities = path.densities
        towards, gap = direction_to(here.point, end.point)
        lobe = here.lobe(towards, allowed & (end.importance > 0))
        value = path.beta * end.importance * lobe.value
        connected = allowed & carries_light(value)
        value *= here.transmission(towards, gap, sampler, connected)
        known = self.world.media.known_transmittance(here.point, towards, gap)
        per_m2 = densities.ratio * densities.start * end.density * known * lobe.cosines
        per_m2 *= dr.select(path.vertex == 1, 1, lobe.backward)
        others = per_m2 * densities.start_m * densities.start_m
        return _Join(value, others, per_m2, lobe, gap, known, connected & carries_light(value))

    def _deposit(
        self, join: _Join, others: Any, vertex: Any, end: Connection, launch: Launch, path: Path
    ) -> None:
        self.deposit(
            Contribution(
                join.value * self.weight(others, vertex, path.crossings > 0),
                end.cell if launch.cell is None else launch.cell,
                path.length_m + join.gap_m + end.length_m,
                path.scatterings + end.scatterings,
                join.active,
            )
        )

    def _leave(self, here: Vertex, turn: Turn, path: Path) -> None:
        """Take the next direction."""
        densities = path.densities
        first, second = path.vertex == 1, path.vertex == 2
        path.beta *= turn.weight
        # Equal in fog, where rounding may make 0 of both. A specular vertex has the same delta in
        # both, and cannot be connected to.
        quotient = dr.select(here.in_fog, 1, turn.backward / turn.forward)
        ratio = dr.select(
            turn.specular,
            dr.select(first, 0, 1),
            dr.select(first, 1 / turn.forward, quotient),
        )
        densities.ratio *= dr.select(turn.straight, 1, ratio * turn.cosines)
        if self.rays is not None:
            settled = dr.select(turn.specular, 0, _quotient(densities.bridge, turn.backward))
            densities.bridge = dr.select(second & ~turn.straight, settled, densities.bridge)
            # Outwards x₁ must be in fog to lie on a ray; inwards x₂ must not be a mirror.
            forward = dr.select(here.in_fog if self.outward else ~turn.specular, turn.forward, 0)
            densities.before_forward = dr.select(turn.straight, densities.before_forward, forward)
            densities.before = dr.select(turn.straight, densities.before, here.point)
        densities.segment_m = dr.select(turn.straight, densities.segment_m, 0)
        densities.through = dr.select(turn.straight, densities.through, 1)
        path.vertex += dr.select(turn.straight, 0, 1)
        path.crossings += dr.select(turn.straight, 1, 0)
        path.ray = turn.ray

    def _roulette(self, turn: Turn, path: Path, scale: Any, limit: Any, sampler: Any) -> None:
        """End paths that carry little, without bias, and those that are too long."""
        survival = dr.select(
            (path.vertex <= ROULETTE_VERTEX) | turn.straight,
            1,
            dr.minimum(path.beta * scale, MAX_SURVIVAL),
        )
        path.active &= (sampler.next_1d(path.active) < survival) & carries_light(path.beta)
        path.active &= (path.vertex <= limit) & (path.crossings <= MAX_CROSSINGS)
        path.beta *= dr.rcp(survival)


def lanes(count: int, seed: int) -> tuple[Any, Any]:
    """Lane numbers and a sampler for them."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, seed), count)
    return dr.arange(mi.UInt32, count), sampler


def _quotient(part: Any, whole: Any) -> Any:
    """part / whole, 0 where a strategy has no density."""
    return dr.select(whole > 0, part / whole, 0)
