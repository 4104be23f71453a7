"""Random walk through scene and fog that connects every vertex to the opposite end.

The balance heuristic (Veach 1997, §9.2) needs, for each path x₁…xₙ, the ratio of the density
with which the opposite end would have built it to the density with which this end did:

    R = [κW_other / κW_this] · [d_start² / d_end²] · [Tr(d_end) / Tr(d_start)]
        · Π_{i=1..n} cout_i / cin_i · Π_{i=2..n} pr_i / Π_{i=1..n-1} pf_i

pf_i (pr_i) is the solid-angle density of leaving vertex i forwards (backwards), cin_i and cout_i
the cosines at a surface (1 in fog), d_start and d_end the first and last segment. Inner distances
and transmittances cancel, so the ratio is carried along in one number.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi

from spisim.transport.ends import Connection, Launch
from spisim.transport.fog import Fog

#: Russian roulette starts here; before, a path that carries little is still worth its cost.
ROULETTE_VERTEX = 6


class End(Protocol):
    """One end of the light paths; see `spisim.transport.ends`."""

    def launch(self, lane: Any, sampler: Any) -> Launch: ...
    def density(self, launch: Launch, first_vertex: Any) -> Any: ...
    def connect(self, lane: Any, vertex: Any, sampler: Any) -> Connection: ...


#: Weight of a contribution, from (ratio R, vertex number n, whether the vertex is on a surface).
Weight = Callable[[Any, Any, Any], Any]
#: Receives (value, cell, path length in m, vertex number n, active).
Deposit = Callable[[Any, Any, Any, Any, Any], None]


@dr.syntax
def walk(
    scene: Any,
    fog: Fog,
    this: End,
    other: End,
    lane: Any,
    sampler: Any,
    max_vertices: Any,
    weight: Weight,
    deposit: Deposit,
) -> None:
    """Launch one path per lane from `this` end and deposit what each vertex sends to `other`."""
    bsdf_context = mi.BSDFContext()
    launch = this.launch(lane, sampler)
    ray = mi.Ray3f(launch.origin, launch.direction)
    beta = mi.Float(launch.beta)
    roulette_scale = 1 / launch.beta
    ratio = mi.Float(1)
    start_scale = mi.Float(0)
    length = mi.Float(launch.length_m)
    vertex = mi.UInt32(0)
    active = mi.Bool(True)

    while dr.hint(active, exclude=[fog, this, other, launch]):
        vertex += 1
        si = scene.ray_intersect(ray, active)
        flight = fog.sample_distance(sampler.next_1d(active))
        in_fog = flight < si.t
        distance = dr.select(in_fog, flight, si.t)
        point = ray(distance)
        active &= dr.select(in_fog, fog.contains(point), si.is_valid())
        on_surface = active & ~in_fog
        in_fog &= active
        length += distance
        beta *= dr.select(in_fog, fog.albedo, 1)

        first = vertex == 1
        start_scale = dr.select(
            first,
            distance * distance / (this.density(launch, point) * fog.transmittance(distance)),
            start_scale,
        )

        # Connection to the other end.
        end = other.connect(lane, point, sampler)
        towards = end.point - point
        gap = dr.norm(towards)
        towards *= dr.rcp(gap)
        bsdf = si.bsdf()
        local = si.to_local(towards)
        mei = fog.interaction(point, ray.d)
        phase, _ = fog.phase.eval_pdf(mi.PhaseFunctionContext(), mei, towards, in_fog)
        reflected = bsdf.eval(bsdf_context, si, local, on_surface)
        scattering = dr.select(in_fog, phase.x, reflected.x)
        reverse = dr.select(
            in_fog, phase.x, _reverse_density(bsdf, bsdf_context, si, local, on_surface)
        )
        through = fog.transmittance(gap)
        value = beta * scattering * through * end.importance / (gap * gap)
        connected = active & (value > 0)
        segment = si.spawn_ray_to(end.point)
        segment.o = dr.select(in_fog, point, segment.o)
        segment.d = dr.select(in_fog, towards, segment.d)
        segment.maxt = dr.select(in_fog, gap * (1 - mi.math.ShadowEpsilon), segment.maxt)
        connected &= ~scene.ray_test(segment, connected)
        path_ratio = (
            ratio
            * start_scale
            * (end.density * through / (gap * gap))
            * dr.select(in_fog, 1, _cosine_ratio(local, si.wi))
            * dr.select(first, 1, reverse)
        )
        value *= weight(path_ratio, vertex, on_surface)
        cell = end.cell if launch.cell is None else launch.cell
        deposit(value, cell, length + gap + end.length_m, vertex, connected)

        # Next direction.
        choice = sampler.next_1d(active)
        square = sampler.next_2d(active)
        scattered, phase_weight, phase_density = fog.phase.sample(
            mi.PhaseFunctionContext(), mei, choice, square, in_fog
        )
        sample, bsdf_weight = bsdf.sample(bsdf_context, si, choice, square, on_surface)
        specular = on_surface & mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
        beta *= dr.select(in_fog, phase_weight.x, bsdf_weight.x)
        reverse = dr.select(
            in_fog,
            phase_density,
            _reverse_density(bsdf, bsdf_context, si, sample.wo, on_surface & ~specular),
        )
        forward = dr.select(in_fog, phase_density, sample.pdf)
        # A specular vertex has the same delta in both densities, and cannot be connected to.
        turn = dr.select(specular, dr.select(first, 0, 1), dr.select(first, 1, reverse) / forward)
        ratio *= turn * dr.select(in_fog, 1, _cosine_ratio(sample.wo, si.wi))

        survival = dr.select(vertex < ROULETTE_VERTEX, 1, dr.minimum(beta * roulette_scale, 0.95))
        active &= (sampler.next_1d(active) < survival) & (beta > 0) & (vertex < max_vertices)
        beta *= dr.rcp(survival)

        ray = si.spawn_ray(si.to_world(sample.wo))
        ray.o = dr.select(in_fog, point, ray.o)
        ray.d = dr.select(in_fog, scattered, ray.d)


def _reverse_density(bsdf: Any, context: Any, si: Any, local: Any, active: Any) -> Any:
    """Density of leaving a surface vertex backwards, having arrived along `local`."""
    mirrored = mi.SurfaceInteraction3f(si)
    mirrored.wi = local
    return bsdf.pdf(context, mirrored, si.wi, active)


def _cosine_ratio(outgoing: Any, incoming: Any) -> Any:
    return dr.abs(outgoing.z) / dr.maximum(dr.abs(incoming.z), 1e-7)
