"""A surface that sends light back to where it came from, as a plugin of Mitsuba."""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi

from spisim.scene.bsdf import ENTRANCE_FALL

PLUGIN = "spisim-retroreflector"


def retroreflector(lobe: dict[str, Any]) -> dict[str, Any]:
    """Mitsuba description of a surface that does to the incoming what `lobe` does to the mirrored
    direction; needs an active variant."""
    _register(str(mi.variant()))
    return {"type": PLUGIN, "lobe": lobe}


@cache
def _register(variant: str) -> None:
    """Make the plugin known to one variant, of whose types its class is made."""

    class Retroreflector(mi.BSDF):
        """f(i, o) = lobe(mirrored i, o) · (cos i · cos o)^(k / 2): reciprocal, as the lobe is."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.lobe = properties["lobe"]
            count = self.lobe.component_count()
            self.m_components = [self.lobe.flags(number) for number in range(count)]
            self.m_flags = self.lobe.flags()

        def sample(
            self, context: Any, si: Any, choice: Any, square: Any, active: Any = True
        ) -> Any:
            drawn, weight = self.lobe.sample(context, _mirrored(si), choice, square, active)
            return drawn, weight * _fade(si.wi, drawn.wo)

        def eval(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.lobe.eval(context, _mirrored(si), wo, active) * _fade(si.wi, wo)

        def pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.lobe.pdf(context, _mirrored(si), wo, active)

        def eval_pdf(self, context: Any, si: Any, wo: Any, active: Any = True) -> Any:
            value, density = self.lobe.eval_pdf(context, _mirrored(si), wo, active)
            return value * _fade(si.wi, wo), density

        def traverse(self, callback: Any) -> None:
            callback.put("lobe", self.lobe, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"Retroreflector[{self.lobe}]"

    mi.register_bsdf(PLUGIN, Retroreflector)


def _mirrored(si: Any) -> Any:
    turned = mi.SurfaceInteraction3f(si)
    turned.wi = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
    return turned


def _fade(wi: Any, wo: Any) -> Any:
    return dr.power(dr.maximum(wi.z * wo.z, 0), ENTRANCE_FALL / 2)
