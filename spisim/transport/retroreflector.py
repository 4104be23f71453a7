"""A surface that sends light back to where it came from, as a Mitsuba plugin."""

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from spisim.scene.bsdf import ENTRANCE_FALL
from spisim.transport.jit import Bool, Color, Float, Hit, Object, Point2, Vector

PLUGIN = "spisim-retroreflector"


def retroreflector(roughness: float, reflectance: dict[str, Any]) -> dict[str, Any]:
    """Mitsuba description of a lobe of width α about the incoming direction, in a variant."""
    _register(str(mi.variant()))
    return {"type": PLUGIN, "alpha": float(roughness), "reflectance": reflectance}


@cache
def _register(variant: str) -> None:
    """Register the plugin with a variant, on whose types its class depends."""

    class Retroreflector(mi.BSDF):
        """f(i, o) = reflectance · p(i, o) · (cos i · cos o)^(k / 2 - 1).

        p is the density of directions into which a facet, drawn from the GGX distribution about i,
        mirrors i: D(δ / 2) / 4 for an angle δ between i and o (Walter et al. 2007). It is symmetric
        about i and reciprocal.
        """

        def __init__(self, properties: Object) -> None:
            super().__init__(properties)
            self.alpha = float(properties["alpha"])
            self.reflectance = properties.get_texture("reflectance")
            self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [self.m_flags]

        def sample(
            self, context: Object, si: Hit, choice: Float, uv: Point2, active: Bool = True
        ) -> tuple[Object, Color]:
            facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, False)
            facet, _ = facets.sample(mi.Vector3f(0, 0, 1), uv)
            around = mi.Vector3f(facet.x, facet.y, facet.z) * (2 * facet.z) - mi.Vector3f(0, 0, 1)
            drawn: Object = dr.zeros(mi.BSDFSample3f)
            drawn.wo = mi.Frame3f(si.wi).to_world(around)
            drawn.pdf = self._density(si.wi, drawn.wo)
            drawn.eta = 1
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            return drawn, self._weight(si, drawn.wo, active)

        def eval(self, context: Object, si: Hit, wo: Vector, active: Bool = True) -> Color:
            active &= context.is_enabled(mi.BSDFFlags.GlossyReflection, 0)
            return self._weight(si, wo, active) * self._density(si.wi, wo)

        def pdf(self, context: Object, si: Hit, wo: Vector, active: Bool = True) -> Float:
            return dr.select(active & _above(si.wi, wo), self._density(si.wi, wo), 0)

        def eval_pdf(
            self, context: Object, si: Hit, wo: Vector, active: Bool = True
        ) -> tuple[Color, Float]:
            return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

        def traverse(self, callback: Object) -> None:
            callback.put("reflectance", self.reflectance, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"Retroreflector[alpha={self.alpha}, reflectance={self.reflectance}]"

        def _density(self, wi: Vector, wo: Vector) -> Float:
            """p, from the chord between the two, which is accurate in single precision."""
            sine2 = dr.squared_norm(wo - wi) / 4  # of δ / 2
            spread = (1 - sine2) * self.alpha + sine2 / self.alpha
            return dr.rcp(4 * dr.pi * spread * spread)

        def _weight(self, si: Hit, wo: Vector, active: Bool) -> Color:
            """f cos o / p."""
            fade = dr.power(si.wi.z * wo.z, ENTRANCE_FALL / 2 - 1) * wo.z
            lit = active & _above(si.wi, wo)
            return self.reflectance.eval(si, lit) * dr.select(lit, fade, 0)

    mi.register_bsdf(PLUGIN, Retroreflector)


def _above(wi: Vector, wo: Vector) -> Bool:
    return (wi.z > 0) & (wo.z > 0)
