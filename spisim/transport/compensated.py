"""Rough surfaces with the light that their facets scatter among themselves, as a Mitsuba plugin.

Mitsuba's rough models follow light to one facet and drop what another facet blocks. Of that, the
fraction L(i) of a white surface, a lobe returns (Kulla & Conty, SIGGRAPH course 2017)

    f(i, o) = F · L(i) · L(o) / (π · mean L),

which is reciprocal and makes a white surface lossless. F is the mean reflectance of one facet and
the body beneath, so that light stays proportional to the reflectance of a metal; what meets more
facets should meet their colour more often.
"""

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.coat import NODES, WEIGHTS, albedos
from spisim.transport.jit import Bool, Color, Float, Hit, Object, Point2, Vector

PLUGIN = "spisim-compensated"
#: Cosines of incidence, evenly spaced, at which L is tabulated.
COSINES = np.linspace(0, 1, 65)
#: Mean L below which a surface is left as it is.
NEGLIGIBLE = 0.001


def compensated_metal(
    described: dict[str, Any],
    index: complex | None,
    roughness: float,
    distribution: str,
    reflectance: dict[str, Any],
) -> dict[str, Any]:
    """A rough metal of Mitsuba's, compensated; without an index it is white."""
    white, _ = albedos(None, roughness, distribution)
    facet = 1.0
    if index is not None:
        facet = float(2 * NODES * WEIGHTS @ _metal_reflectance(index))
    return _compensated(described, 1 - white, 0.0, facet, reflectance)


def compensated_plastic(
    described: dict[str, Any],
    ior: float,
    roughness: float,
    distribution: str,
    reflectance: dict[str, Any],
) -> dict[str, Any]:
    """A rough plastic of Mitsuba's, compensated; `reflectance` is that of its body."""
    coat, body = albedos(ior, roughness, distribution)
    gloss, inner = (float(NODES * WEIGHTS @ each) for each in (coat, body))
    both = gloss + inner
    return _compensated(described, 1 - coat - body, gloss / both, inner / both, reflectance)


def _compensated(
    described: dict[str, Any],
    lost: Floats,
    coat: float,
    body: float,
    reflectance: dict[str, Any],
) -> dict[str, Any]:
    """The model with the lobe; `lost` is L at `NODES`, and F is `coat` + `body` · reflectance."""
    table = np.maximum(np.interp(COSINES, NODES, lost), 0)
    low, high = table[:-1], table[1:]
    c, step = COSINES[:-1], COSINES[1]
    mean = float(step * np.sum(c * (low + high) + step * (low + 2 * high) / 3))
    if mean < NEGLIGIBLE:
        return described
    _register(str(mi.variant()))
    return {
        "type": PLUGIN,
        "nested": described,
        "reflectance": reflectance,
        "lost": mi.TensorXf(table.astype(np.float32), (len(table),)),
        "mean": mean,
        "coat": coat,
        "body": body,
    }


def _metal_reflectance(index: complex) -> Floats:
    """Unpolarised reflectance of a metal at `NODES`."""
    inner = np.sqrt(index**2 - 1 + NODES**2)  # index times the cosine inside
    upright = (NODES - inner) / (NODES + inner)
    parallel = (index**2 * NODES - inner) / (index**2 * NODES + inner)
    return np.asarray((np.abs(upright) ** 2 + np.abs(parallel) ** 2) / 2)


@cache
def _register(variant: str) -> None:
    """Register the plugin with a variant, on whose types its class depends."""

    class Compensated(mi.BSDF):
        """A model and the lobe, which is drawn with the probability L(i)."""

        def __init__(self, properties: Object) -> None:
            super().__init__(properties)
            self.nested = properties["nested"]
            self.reflectance = properties.get_texture("reflectance")
            self.lost = mi.Float(properties["lost"].array)
            self.mean = float(properties["mean"])
            self.coat, self.body = float(properties["coat"]), float(properties["body"])
            self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components = [self.m_flags]

        def sample(
            self, context: Object, si: Hit, choice: Float, uv: Point2, active: Bool = True
        ) -> tuple[Object, Color]:
            chance = _interpolated(self.lost, si.wi.z)
            again = choice < chance
            rest = (choice - chance) / dr.maximum(1 - chance, 1e-6)
            drawn, _ = self.nested.sample(context, si, dr.maximum(rest, 0), uv, active & ~again)
            drawn.wo = dr.select(again, mi.warp.square_to_cosine_hemisphere(uv), drawn.wo)
            value, drawn.pdf = self.eval_pdf(context, si, drawn.wo, active)
            drawn.eta = 1
            drawn.sampled_component = 0
            drawn.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            return drawn, dr.select(drawn.pdf > 0, value / drawn.pdf, 0)

        def eval(self, context: Object, si: Hit, wo: Vector, active: Bool = True) -> Color:
            return self.nested.eval(context, si, wo, active) + self._lobe(context, si, wo, active)

        def pdf(self, context: Object, si: Hit, wo: Vector, active: Bool = True) -> Float:
            return self._density(si, wo, self.nested.pdf(context, si, wo, active), active)

        def eval_pdf(
            self, context: Object, si: Hit, wo: Vector, active: Bool = True
        ) -> tuple[Color, Float]:
            value, density = self.nested.eval_pdf(context, si, wo, active)
            value += self._lobe(context, si, wo, active)
            return value, self._density(si, wo, density, active)

        def _lobe(self, context: Object, si: Hit, wo: Vector, active: Bool) -> Color:
            """f cos o; where only the body is asked for, the part that its reflectance scales."""
            lit = active & (si.wi.z > 0) & (wo.z > 0)
            facet = self.body * self.reflectance.eval(si, lit)
            if mi.has_flag(context.type_mask, mi.BSDFFlags.GlossyReflection):
                facet += self.coat
            lobe = (
                _interpolated(self.lost, si.wi.z)
                * _interpolated(self.lost, wo.z)
                * wo.z
                * (dr.inv_pi / self.mean)
            )
            return facet * dr.select(lit, lobe, 0)

        def _density(self, si: Hit, wo: Vector, nested: Float, active: Bool) -> Float:
            chance, lit = _interpolated(self.lost, si.wi.z), active & (si.wi.z > 0) & (wo.z > 0)
            return dr.select(lit, dr.lerp(nested, wo.z * dr.inv_pi, chance), 0)

    mi.register_bsdf(PLUGIN, Compensated)


def _interpolated(table: Float, cosine: Float) -> Float:
    """L by the cosine of incidence."""
    place = dr.clip(cosine, 0, 1) * (len(COSINES) - 1)
    below = dr.minimum(mi.UInt32(place), len(COSINES) - 2)
    low, high = (dr.gather(mi.Float, table, below + k) for k in (0, 1))
    return dr.lerp(low, high, place - mi.Float(below))
