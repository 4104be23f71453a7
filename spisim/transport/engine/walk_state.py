"""A path under way, and what the balance heuristic has to know of it.

The heuristic (Veach 1997, §9.2) needs, for each path x₁…xₙ, the ratio of the density with which the
opposite end would have built it to the density with which this end did:

    R = [κW_other / κW_this] · [d_start² / d_end²] · [Tr(d_end) / Tr(d_start)]
        · Π_{i=1..n} cout_i / cin_i · Π_{i=2..n} pr_i / Π_{i=1..n-1} pf_i

pf_i (pr_i) is the solid-angle density of leaving vertex i forwards (backwards), cin_i and cout_i
the cosines at a surface (1 in fog), d_start and d_end the first and last segment. Inner distances
and transmittances cancel, so the ratio is carried along in one number. Factors of Tr that have no
closed form are left out for all strategies alike, which keeps the weights' sum at one.

The density of the third strategy, the bridge (`rays`), relative to that of the detector's depends
on the three points next to the projector alone,

    S = rays(x₀, x₁, x₂) · |x₁-x₂|² / (pr₂ · Tr(x₁,x₂))

so it costs the others' weights, 1 / (1 + R + R S) and 1 / (1 + R + S), next to nothing. R goes
with d_start², S of the projector's strategy with 1/d_start²: what is kept of them is R / d_start²
and S d_start², for a collision may lie so close to the projector that it rounds to the same point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.ends import Connection, Launch
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.tally import carries_light
from spisim.transport.engine.vertex import Lobe, Turn
from spisim.transport.geometry import direction_to
from spisim.transport.jit import Bool, Float, Point, Ray, Sampler, UInt

#: Russian roulette starts here; before, a path that carries little is still worth its cost.
ROULETTE_VERTEX = 5
#: Surfaces that a path passes straight through, all in all.
MAX_CROSSINGS = 64


class Ratio(NamedTuple):
    """R of one connection."""

    value: Float
    per_m2: Float  # R / d_start²


@dataclass
class Densities:
    """What is known of R and S so far."""

    ratio: Float  # Π cout / cin · Π pr / Π pf
    start: Float  # 1 / (κW_this Tr(d_start))
    start_m: Float  # d_start
    segment_m: Float
    through: Float  # Tr of the segment, as far as it has a closed form
    before: Point  # last vertex
    before_forward: Float  # density of leaving it; 0 where the bridge has no part
    bridge: Float  # S d_start²

    @classmethod
    def start_at(cls, point: Point) -> Densities:
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

    @property
    def met_mirror_first(self) -> Bool:
        """Whether no path of the other end would have been this one."""
        return self.ratio * self.start == 0

    def go(self, distance: Float, through: Float) -> None:
        """Lengthen the segment by a flight."""
        self.segment_m += distance
        self.through *= through

    def arrive_first(self, first: Bool, launched: Float) -> None:
        """Where it is the `first` vertex: paths leave the end towards it with density κW."""
        self.start = dr.select(first, dr.rcp(launched * self.through), self.start)
        self.start_m = dr.select(first, self.segment_m, self.start_m)

    def other_end(self, lobe: Lobe, end: Connection, given: Float, first: Bool) -> Ratio:
        """R of a connection to the other end over a gap of `given` transmittance."""
        per_m2 = self.ratio * self.start * end.density * given * lobe.cosines
        per_m2 *= dr.select(first, 1, lobe.backward)
        return Ratio(per_m2 * self.start_m * self.start_m, per_m2)

    def bridge_outward(
        self, rays: FogRays, start: Float, point: Point, lobe: Lobe, ratio: Ratio, second: Bool
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
        """Density of a picked `position`, by its solid angle from the end, over the walk's.

        Times the cosine towards the end over that of arrival.
        """
        return quotient(density * self.segment_m * self.segment_m, self.before_forward)

    def leave(self, turn: Turn, in_fog: Bool, first: Bool) -> None:
        """Turn at a vertex. The same delta is in both densities of a specular one, which cannot be
        connected to; in fog they are equal, where rounding may make 0 of both."""
        inner = dr.select(in_fog, 1, turn.backward / turn.forward)
        ratio = dr.select(
            turn.specular,
            dr.select(first, 0, 1),
            dr.select(first, 1 / turn.forward, inner),
        )
        self.ratio *= dr.select(turn.straight, 1, ratio * turn.cosines)
        self.segment_m = dr.select(turn.straight, self.segment_m, 0)
        self.through = dr.select(turn.straight, self.through, 1)

    def settle_bridge(self, turn: Turn, point: Point, second: Bool, allowed: Bool) -> None:
        """Keep what S will need: of the second vertex pr₂, of every one its place and density.

        `allowed`: outwards x₁ must be in fog to lie on a ray; inwards x₂ must be no mirror.
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
        """End paths that carry little, without bias, and those that are too long.

        What survives carries `ending` of its start: no weight ever grows beyond that.
        """
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

    @classmethod
    def start(cls, launch: Launch, limit: UInt) -> WalkState:
        """At an end, if it may have as many vertices as one."""
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
        )


def quotient(part: Float, whole: Float) -> Float:
    """part / whole, 0 where a strategy has no density."""
    return dr.select(whole > 0, part / whole, 0)
