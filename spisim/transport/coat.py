"""How much light a clear coat transmits to the diffuse body beneath it, and out again."""

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.jit import Float, Hit, Object, UInt, Vector

#: Cosines of incidence, and weights of their quadrature from 0 to 1.
NODES, WEIGHTS = (np.polynomial.legendre.leggauss(32) + np.array([[1.0], [0.0]])) / 2

#: Facets per side of the square from which they are drawn, most of them at its edges: steep ones.
FACETS = 96


@cache
def body_scale(ior: float, roughness: float, distribution: str) -> float:
    """Factor on the reflectance of Mitsuba's plastics that makes their body lossless.

    Light transmitted by the coat, T(i), should leave as T(i) T(o) cos(o) / π over the mean of T, so
    that a body of reflectance 1 returns T(i) and both albedos sum to at most 1 (Shirley et al.
    1997). Mitsuba divides by the mean inward reflectance of the coat instead. For a smooth coat
    (`roughness` 0) that is a fit, 0.1 % too bright; for a rough coat it lacks multiple scattering,
    which at a roughness of 0.2 is 20 % too dark.
    """
    cosines = np.repeat(NODES, NODES.size), np.tile(NODES, NODES.size)
    weights = 4 * np.outer(NODES * WEIGHTS, NODES * WEIGHTS).ravel()
    body = _body_term(ior, roughness, distribution, *cosines)
    _, through = albedos(ior, roughness, distribution)
    return float(2 * NODES * WEIGHTS @ through / (weights @ body))


@cache
def albedos(ior: float | None, roughness: float, distribution: str) -> tuple[Floats, Floats]:
    """Light reflected and transmitted at the first facet at `NODES`; None for white facets."""
    u, weights = (np.polynomial.legendre.leggauss(FACETS) + np.array([[1.0], [0.0]])) / 2
    drawn = np.meshgrid(NODES, u, u, indexing="ij")
    cosine, first, second = (axis.ravel() for axis in drawn)
    wi = _directions(cosine)
    kinds = mi.MicrofacetType
    kind = kinds.Beckmann if distribution == "beckmann" else kinds.GGX
    facets: Object = mi.MicrofacetDistribution(kind, roughness, True)
    normal, _ = facets.sample(wi, mi.Point2f(np.array([first, second], dtype=np.float32)))
    index: UInt = mi.Float(ior or 1.0)
    facing, inner, _, ratio = mi.fresnel(dr.dot(wi, normal), index)
    fraction = mi.Float(1) if ior is None else facing

    def left(fraction: Float, leaving: Vector, above: bool) -> Floats:
        light = np.array((fraction * facets.smith_g1(leaving, normal)).numpy(), np.float64)
        light[(leaving.z.numpy() > 0) != above] = 0
        return np.asarray(light.reshape(NODES.size, -1) @ np.outer(weights, weights).ravel())

    mirrored = mi.reflect(wi, mi.Normal3f(normal))
    inside = mi.refract(wi, normal, inner, ratio)
    return left(fraction, mirrored, True), left(1 - fraction, inside, False)


def _body_term(
    ior: float, roughness: float, distribution: str, cos_in: Floats, cos_out: Floats
) -> Floats:
    """π f(i, o) of Mitsuba's plugin for a body of reflectance 1."""
    white = {"type": "rgb", "value": [1.0] * 3}
    bsdf: Object = mi.load_dict(plastic(ior, roughness, distribution, white))
    context = mi.BSDFContext()
    context.component = 1
    si: Hit = mi.SurfaceInteraction3f()
    si.wi = _directions(cos_in)
    value = bsdf.eval(context, si, _directions(cos_out)).x.numpy()
    return np.pi * np.asarray(value, np.float64) / cos_out


def plastic(
    ior: float, roughness: float, distribution: str, body: dict[str, Any]
) -> dict[str, Any]:
    """Mitsuba's plastic in air over a body of this reflectance; smooth for a roughness of 0."""
    described = {
        "type": "plastic",
        "int_ior": float(ior),
        "ext_ior": 1.0,
        "diffuse_reflectance": body,
    }
    if roughness > 0:
        described |= {"type": "roughplastic", "distribution": distribution}
        described["alpha"] = float(roughness)
    return described


def _directions(cosines: Floats) -> Vector:
    sines = np.sqrt(1 - cosines**2)
    return mi.Vector3f(np.array([sines, np.zeros_like(sines), cosines], dtype=np.float32))
