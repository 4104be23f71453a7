"""The state of a walk, including the densities that the balance heuristic needs.

The heuristic (Veach 1997, §9.2) needs, for each path x₁…xₙ, the ratio of the density with which the
opposite end would have built it to the density with which this end did:

    R = [κW_other / κW_this] · [d_start² / d_end²] · [Tr(d_end) / Tr(d_start)]
        · Π_{i=1..n} cout_i / cin_i · Π_{i=2..n} pr_i / Π_{i=1..n-1} pf_i

pf_i (pr_i) is the solid-angle density of leaving vertex i forwards (backwards), cin_i and cout_i
are the cosines at a surface (1 in fog), and d_start and d_end the first and last segment. Inner
distances and transmittances cancel, so one number carries the ratio along. Factors of Tr without a
closed form are left out for all strategies alike, which keeps the sum of the weights at one.

The density of the third strategy, the bridge (`rays`), relative to that of the detector's depends
only on the three points next to the projector,

    S = rays(x₀, x₁, x₂) · |x₁-x₂|² / (pr₂ · Tr(x₁,x₂))

so it adds next to nothing to the cost of the weights 1 / (1 + R + R S) and 1 / (1 + R + S). R
scales with d_start², S of the projector's strategy with 1/d_start². The state holds R / d_start²
and S d_start², because a collision may lie so close to the projector that it rounds to the same
point.
"""

from dataclasses import dataclass
from typing import NamedTuple, Self

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.ends import Connection, Launch
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.tally import carries_light
from spisim.transport.engine.vertex import Lobe, Turn
from spisim.transport.geometry import direction_to
from spisim.transport.jit import Bool, Float, Point, Ray, Sampler, UInt
from spisim.transport.scores import Scores, together

#: Russian roulette starts here; before, a path that carries little is still worth its cost.
ROULETTE_VERTEX = 5
#: Maximum number of surfaces that a path passes straight through.
MAX_CROSSINGS = 64


class Ratio(NamedTuple):
    """R of one connection."""

    value: Float
    per_m2: Float  # R / d_start²


@dataclass
class Densities:
    """Factors of R and S so far."""

    ratio: Float  # Π cout / cin · Π pr / Π pf
    start: Float  # 1 / (κW_this Tr(d_start))
    start_m: Float  # d_start
    segment_m: Float
    through: Float  # closed-form factors of Tr of the segment
    before: Point  # last vertex
    before_forward: Float  # density of leaving it; 0 where the bridge has no part
    bridge: Float  # S d_start²

    @classmethod
    def start_at(cls, point: Point) -> Self:
        """Densities of a path that starts at an end."""
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

    @property
    def met_mirror_first(self) -> Bool:
        """Whether the other end could not have built this path."""
        return self.ratio * self.start == 0

    def go(self, distance: Float, through: Float) -> None:
        """Lengthen the segment by a flight."""
        self.segment_m += distance
        self.through *= through

    def arrive_first(self, first: Bool, launched: Float) -> None:
        """At the `first` vertex: store the density κW with which paths leave the end towards it."""
        self.start = dr.select(first, dr.rcp(launched * self.through), self.start)
        self.start_m = dr.select(first, self.segment_m, self.start_m)

    def other_end(self, lobe: Lobe, end: Connection, given: Float, first: Bool) -> Ratio:
        """R of a connection to the other end over a gap of `given` transmittance."""
        per_m2 = self.ratio * self.start * end.density * given * lobe.cosines
        per_m2 *= dr.select(first, 1, lobe.backward)
        return Ratio(per_m2 * self.start_m * self.start_m, per_m2)

    def bridge_outward(
        self, rays: FogRays, start: Ray, point: Point, lobe: Lobe, ratio: Ratio, second: Bool
    ) -> Float:
        """R S where the walk comes from the projector, along the ray `start`, to `point`."""
        density = rays.density(start, self.start_m, point)
        bridge = dr.select(self.before_forward > 0, self._over_segment(density), 0)
        self.bridge = dr.select(second, bridge, self.bridge)
        at_second = quotient(self.bridge, lobe.backward)
        return ratio.per_m2 * dr.select(second, at_second, self.bridge)

    def bridge_inward(self, rays: FogRays, lens: Point, point: Point, in_fog: Bool) -> Float:
        """S where the walk comes from the detector and `point` is connected to the `lens`."""
        direction, gap = direction_to(lens, point)
        density = rays.density(mi.Ray3f(lens, direction), gap, self.before)
        bridge = quotient(self._over_segment(density), self.before_forward * gap * gap)
        return dr.select(in_fog, bridge, 0)

    def footprint(self, density: Float) -> Float:
        """Density of a picked point, by its solid angle from the end, over that of the walk.

        It is multiplied by the cosine towards the end over that of arrival.
        """
        return quotient(density * self.segment_m * self.segment_m, self.before_forward)

    def leave(self, turn: Turn, in_fog: Bool, first: Bool) -> None:
        """Update the ratio at a turn, where deltas and symmetric phase functions cancel."""
        inner = dr.select(in_fog, 1, turn.backward / turn.forward)
        ratio = dr.select(
            turn.specular, dr.select(first, 0, 1), dr.select(first, 1 / turn.forward, inner)
        )
        self.ratio *= dr.select(turn.straight, 1, ratio * turn.cosines)
        self.segment_m = dr.select(turn.straight, self.segment_m, 0)
        self.through = dr.select(turn.straight, self.through, 1)

    def settle_bridge(self, turn: Turn, point: Point, second: Bool, allowed: Bool) -> None:
        """Store what S needs: pr₂ of the second vertex, and position and density of each vertex.

        `allowed`: an outward x₁ must be in fog to lie on a ray; an inward x₂ must be no mirror.
        """
        settled = dr.select(turn.specular, 0, quotient(self.bridge, turn.backward))
        self.bridge = dr.select(second & ~turn.straight, settled, self.bridge)
        forward = dr.select(allowed, turn.forward, 0)
        self.before_forward = dr.select(turn.straight, self.before_forward, forward)
        self.before = dr.select(turn.straight, self.before, point)

    def _over_segment(self, value: Float) -> Float:
        """`value` times the segment's length² over its transmittance."""
        return value * self.segment_m * self.segment_m / self.through


@dataclass
class PathState:
    """One path per lane, on its way to vertex number `vertex`."""

    ray: Ray
    beta: Float  # weight
    vertex: UInt
    crossings: UInt  # surfaces passed straight through
    active: Bool

    def follow(self, turn: Turn) -> None:
        """Take the next direction."""
        self.vertex += dr.select(turn.straight, 0, 1)
        self.crossings += dr.select(turn.straight, 1, 0)
        self.ray = turn.ray

    def roulette(
        self, turn: Turn, scale: Float, ending: float, max_vertices: UInt, sampler: Sampler
    ) -> None:
        """End paths that carry little or are too long; survivors carry `ending` of their start."""
        survival = dr.select(
            (self.vertex <= ROULETTE_VERTEX) | turn.straight,
            1,
            dr.minimum(self.beta * scale / ending, 1),
        )
        self.active &= (sampler.next_1d(self.active) < survival) & carries_light(self.beta)
        self.active &= (self.vertex <= max_vertices) & (self.crossings <= MAX_CROSSINGS)
        self.beta *= dr.rcp(survival)


@dataclass
class WalkState(PathState):
    """A path of `Walk`."""

    length_m: Float
    scatterings: UInt
    densities: Densities
    scores: Scores

    @classmethod
    def start(cls, launch: Launch, limit: UInt, scores: Scores) -> Self:
        """At an end, active if it may have at least one vertex."""
        beta = mi.Float(launch.beta)
        return cls(
            ray=mi.Ray3f(launch.origin, launch.direction),
            beta=beta,
            length_m=mi.Float(launch.length_m),
            scatterings=mi.UInt32(launch.scatterings),
            vertex=mi.UInt32(1),
            crossings=mi.UInt32(launch.crossings),
            active=carries_light(beta) & (limit > 0),
            densities=Densities.start_at(launch.origin),
            scores=together(scores, launch.scores),
        )


def quotient(part: Float, whole: Float) -> Float:
    """part / whole, 0 where a strategy has no density."""
    return dr.select(whole > 0, part / whole, 0)
