"""How much light a clear coat transmits to the diffuse body beneath it, and out again."""

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.jit import Hit, Object, UInt, Vector

_NODES, _WEIGHTS = (np.polynomial.legendre.leggauss(32) + np.array([[1.0], [0.0]])) / 2


@cache
def body_scale(ior: float, roughness: float, distribution: str) -> float:
    """Factor on the reflectance of Mitsuba's plastics that makes their body lossless.

    Light transmitted by the coat, T(i), should leave as T(i) T(o) cos(o) / π over the mean of T, so
    that a body of reflectance 1 returns T(i) and both albedos sum to at most 1 (Shirley et al.
    1997). Mitsuba divides by the mean inward reflectance of the coat instead. For a smooth coat
    (`roughness` 0) that is a fit, 0.1 % too bright; for a rough coat it lacks multiple scattering,
    which at a roughness of 0.2 is 20 % too dark.
    """
    cosines = np.repeat(_NODES, _NODES.size), np.tile(_NODES, _NODES.size)
    weights = 4 * np.outer(_NODES * _WEIGHTS, _NODES * _WEIGHTS).ravel()
    body = _body_term(ior, roughness, distribution, *cosines)
    through = _transmittance(ior, roughness, distribution)
    return float(2 * _NODES * _WEIGHTS @ through / (weights @ body))


def _transmittance(ior: float, roughness: float, distribution: str) -> Floats:
    """T at `_NODES`, cosines of incidence: light transmitted at the first pass, by quadrature."""
    count = _NODES.size
    cosine, first, second = (axis.ravel() for axis in np.meshgrid(*[_NODES] * 3, indexing="ij"))
    wi = _directions(cosine)
    kinds = mi.MicrofacetType
    kind = kinds.Beckmann if distribution == "beckmann" else kinds.GGX
    facets: Object = mi.MicrofacetDistribution(kind, roughness, True)
    normal, _ = facets.sample(wi, mi.Point2f(np.array([first, second], dtype=np.float32)))
    index: UInt = mi.Float(ior)
    reflected, inner, _, ratio = mi.fresnel(dr.dot(wi, normal), index)
    inside = mi.refract(wi, normal, inner, ratio)
    through = np.asarray(((1 - reflected) * facets.smith_g1(inside, normal)).numpy(), np.float64)
    through[inside.z.numpy() >= 0] = 0
    return through.reshape(count, count * count) @ np.outer(_WEIGHTS, _WEIGHTS).ravel()


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
