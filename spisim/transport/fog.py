"""The scattering medium as the transport sees it: homogeneous, filling a ball around the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from spisim.atmosphere import Atmosphere


@dataclass(frozen=True, eq=False)
class Fog:
    """Homogeneous medium in a ball that contains every surface and the instrument.

    A ball is convex: any two points inside are joined by a segment inside, so transmittance is
    `exp(-σ d)` for every connection. Only light that leaves the ball, which no surface can
    return, is lost.
    """

    extinction_per_m: Any  # opaque Float
    albedo: Any  # opaque Float
    phase: Any  # mi.PhaseFunction
    centre: Any  # opaque Point3f
    radius_m: Any  # opaque Float

    @classmethod
    def of(cls, atmosphere: Atmosphere, centre: Any, radius_m: float) -> Fog:
        return cls(
            extinction_per_m=dr.opaque(mi.Float, atmosphere.extinction_per_m),
            albedo=dr.opaque(mi.Float, atmosphere.albedo),
            phase=mi.load_dict({"type": "hg", "g": atmosphere.g}),
            centre=dr.opaque(mi.Point3f, centre),
            radius_m=dr.opaque(mi.Float, radius_m),
        )

    def transmittance(self, distance: Any) -> Any:
        return dr.exp(-self.extinction_per_m * distance)

    def sample_distance(self, sample: Any) -> Any:
        """Free flight with density σ exp(-σ t); infinite in clear air."""
        return dr.select(
            self.extinction_per_m > 0, -dr.log(1 - sample) / self.extinction_per_m, dr.inf
        )

    def contains(self, point: Any) -> Any:
        return dr.squared_norm(point - self.centre) <= dr.square(self.radius_m)

    def exit_distance(self, origin: Any, direction: Any) -> Any:
        """Distance from a point inside to the ball's surface."""
        offset = origin - self.centre
        b = dr.dot(offset, direction)
        return -b + dr.sqrt(dr.maximum(b * b + self.radius_m**2 - dr.squared_norm(offset), 0))

    def interaction(self, point: Any, incoming: Any) -> Any:
        """Interaction record at `point` for light travelling along `incoming`."""
        mei: Any = dr.zeros(mi.MediumInteraction3f)
        mei.p = point
        mei.wi = -incoming
        mei.sh_frame = mi.Frame3f(mei.wi)
        return mei
