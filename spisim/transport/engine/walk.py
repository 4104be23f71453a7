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
to x₂, and x₁ on a ray that the projector sends out (`spisim.transport.engine.rays`). Its density relative
to that of the detector's strategy depends on the three points next to the projector alone,

    S = rays(x₀, x₁, x₂) · |x₁-x₂|² / (pr₂ · Tr(x₁,x₂))

so it costs the others' weights, 1 / (1 + R + R S) and 1 / (1 + R + S), next to nothing.

Surfaces that let light pass straight on (panes, holes in a mask) are no vertices: a segment runs
through them and is weakened, as in fog.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import drjit as dr
import mitsuba as mi

from spisim.transport.engine.ends import Connection, Launch
from spisim.transport.engine.vertex import Vertex
from spisim.transport.geometry import Geometry
from spisim.transport.media import Media

#: Russian roulette starts here; before, a path that carries little is still worth its cost.
ROULETTE_VERTEX = 5
#: Most surfaces that a path passes straight through, all in all.
MAX_CROSSINGS = 64


class Source(Protocol):
    """An end that launches paths; see `spisim.transport.engine.ends`."""

    def launch(self, lane: Any, sampler: Any) -> Launch:
        """Start the lane's path."""
        ...

    def density(self, launch: Launch, first_vertex: Any) -> Any:
        """Number density (1/sr) with which it was started."""
        ...


class Sink(Protocol):
    """An end that paths are connected to."""

    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection:
        """The end as seen from a vertex."""
        ...


class Rays(Protocol):
    """Rays of the projector, whose points in fog a detector's walk is connected to."""

    def connect(self, vertex: Any, sampler: Any, active: Any) -> tuple[Connection, Any]:
        """A point of a ray as an end, and `density` of its place."""
        ...

    def density(self, lens: Any, first: Any, second: Any) -> Any:
        """Number density with which `connect` picks `first` on a ray from `lens`, seen from
        `second`, over that of a free flight's collision there, 1/m² ."""
        ...


class Contribution(NamedTuple):
    """Light on its way between the two ends, found at one vertex."""

    value: Any
    cell: Any
    length_m: Any  # whole optical path
    scatterings: Any  # in fog, along the whole path
    active: Any


#: Weight of a contribution, from the sum of the other strategies' densities relative to this
#: one's, the vertex number n, and whether the walk has passed straight through a surface.
Weight = Callable[[Any, Any, Any], Any]
Deposit = Callable[[Contribution], None]
#: Radiance from outside the scene, by direction of the leaving path.
Sky = Callable[[Any], Any]


@dr.syntax
def walk(
    geometry: Geometry,
    media: Media,
    this: Source,
    other: Sink,
    rays: Any,  # Rays | None
    lane: Any,
    sampler: Any,
    max_vertices: Any,
    mode: Any,
    weight: Weight,
    deposit: Deposit,
    sky: Any,  # Sky | None
) -> None:
    """Launch one path per lane from `this` end and deposit what each vertex sends to `other`.

    `mode` is the Mitsuba transport mode of the walk: Importance where it starts at an emitter.
    With `rays`, the third strategy takes part; a walk from a detector then carries it out.
    """
    context = mi.BSDFContext(mode)
    outward = mode == mi.TransportMode.Importance
    launch = this.launch(lane, sampler)
    ray = mi.Ray3f(launch.origin, launch.direction)
    beta = mi.Float(launch.beta)
    roulette_scale = 1 / launch.beta
    ratio = mi.Float(1)
    start_scale = mi.Float(0)
    through = mi.Float(1)  # of the segment, as far as it has a closed form
    segment = mi.Float(0)
    before = mi.Point3f(launch.origin)
    before_density = mi.Float(0)  # of leaving there; 0 where a third strategy has no part
    bridge = mi.Float(0)
    length = mi.Float(launch.length_m)
    scatterings = mi.UInt32(launch.scatterings)
    vertex = mi.UInt32(1)
    crossings = mi.UInt32(0)
    active = beta > 0

    while dr.hint(active, exclude=[geometry, media, this, other, rays, launch, context]):
        si = geometry.scene.ray_intersect(ray, active)
        collision = media.flight(ray, si.t, sampler, active)
        in_fog = active & (collision.distance < si.t)
        distance = dr.select(in_fog, collision.distance, si.t)
        on_surface = active & ~in_fog & si.is_valid()
        escaped = active & ~in_fog & ~on_surface
        if dr.hint(sky is not None, mode="scalar"):
            deposit(Contribution(beta * sky(ray.d), launch.cell, length, scatterings, escaped))
        active &= ~escaped
        distance = dr.select(active, distance, 0)
        point = mi.Point3f(ray(distance))
        segment += distance
        length += distance
        scatterings += dr.select(in_fog, 1, 0)
        beta *= dr.select(in_fog, media.albedo(collision.medium), 1)
        through *= media.known_transmittance(ray.o, ray.d, distance)
        here = Vertex(
            geometry, media, context, si, collision.medium, point, ray.d, in_fog, on_surface
        )
        first, second = vertex == 1, vertex == 2
        start_scale = dr.select(
            first, segment * segment / (this.density(launch, point) * through), start_scale
        )

        # Connection to the other end.
        end = other.connect(lane, point, sampler)
        towards, gap = direction_to(point, end.point)
        lobe = here.lobe(towards, active & (end.importance > 0))
        value = beta * end.importance * lobe.value
        connected = active & (value > 0)
        value *= here.transmission(towards, gap, sampler, connected)
        known = media.known_transmittance(point, towards, gap)
        others = ratio * start_scale * end.density * known * lobe.cosines
        others *= dr.select(first, 1, lobe.backward)
        if dr.hint(rays is not None and outward, mode="scalar"):
            reach = rays.density(launch.origin, before, point) * segment * segment / through
            bridge = dr.select(second, dr.select(before_density > 0, reach, 0), bridge)
            others *= 1 + dr.select(second, _quotient(bridge, lobe.backward), bridge)
        if dr.hint(rays is not None and not outward, mode="scalar"):
            reach = rays.density(end.point, point, before) * segment * segment / through
            others += dr.select(in_fog, _quotient(reach, before_density), 0)
        deposit(
            Contribution(
                value * weight(others, vertex, crossings > 0),
                end.cell if launch.cell is None else launch.cell,
                length + gap + end.length_m,
                scatterings + end.scatterings,
                connected & (value > 0),
            )
        )

        # The third strategy: on to a point of a ray from the other end.
        if dr.hint(rays is not None and not outward, mode="scalar"):
            end, reach = rays.connect(point, sampler, active)
            towards, gap = direction_to(point, end.point)
            lobe = here.lobe(towards, active & (end.importance > 0))
            value = beta * end.importance * lobe.value
            connected = active & (value > 0) & (vertex < max_vertices)
            value *= here.transmission(towards, gap, sampler, connected)
            known = media.known_transmittance(point, towards, gap)
            others = ratio * start_scale * end.density * known * lobe.cosines
            others *= dr.select(first, 1, lobe.backward)
            others += _quotient(lobe.forward * known, reach * gap * gap)
            deposit(
                Contribution(
                    value * weight(others, vertex + 1, crossings > 0),
                    end.cell,
                    length + gap + end.length_m,
                    scatterings + end.scatterings,
                    connected & (value > 0),
                )
            )

        # Next direction.
        turn = here.turn(sampler.next_1d(active), sampler.next_2d(active))
        beta *= turn.weight
        # A specular vertex has the same delta in both densities, and cannot be connected to.
        densities = dr.select(
            turn.specular,
            dr.select(first, 0, 1),
            dr.select(first, 1, turn.backward) / turn.forward,
        )
        ratio *= dr.select(turn.straight, 1, densities * turn.cosines)
        if dr.hint(rays is not None, mode="scalar"):
            settled = dr.select(turn.specular, 0, _quotient(bridge, turn.backward))
            bridge = dr.select(second & ~turn.straight, settled, bridge)
            # Outwards x₁ must be in fog to lie on a ray; inwards x₂ must not be a mirror.
            fit = dr.select(outward, in_fog, ~turn.specular)
            before_density = dr.select(
                turn.straight, before_density, dr.select(fit, turn.forward, 0)
            )
            before = dr.select(turn.straight, before, point)
        segment = dr.select(turn.straight, segment, 0)
        through = dr.select(turn.straight, through, 1)
        vertex += dr.select(turn.straight, 0, 1)
        crossings += dr.select(turn.straight, 1, 0)

        survival = dr.select(
            (vertex <= ROULETTE_VERTEX) | turn.straight,
            1,
            dr.minimum(beta * roulette_scale, 0.95),
        )
        active &= (sampler.next_1d(active) < survival) & (beta > 0)
        active &= (vertex <= max_vertices) & (crossings <= MAX_CROSSINGS)
        beta *= dr.rcp(survival)
        ray = turn.ray


def direction_to(start: Any, stop: Any) -> tuple[Any, Any]:
    """Unit vector and distance from one point to another."""
    offset = mi.Vector3f(stop - start)
    gap = dr.norm(offset)
    return offset * dr.rcp(gap), gap


def _quotient(part: Any, whole: Any) -> Any:
    """part / whole, 0 where a strategy has no density."""
    return dr.select(whole > 0, part / whole, 0)
