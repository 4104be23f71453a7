"""Equi-angular sampling along a ray (Kulla & Fajardo, EGSR 2012)."""

from __future__ import annotations

from typing import Any, NamedTuple

import drjit as dr


class EquiAngular(NamedTuple):
    """Distances along a ray, uniform in the angle under which a point sees them."""

    foot: Any  # distance of the point's foot on the ray
    height: Any  # of the point above the ray
    low: Any
    high: Any

    @classmethod
    def about(cls, point: Any, ray: Any, far: Any, near: Any = 0.0) -> EquiAngular:
        offset = point - ray.o
        foot = dr.dot(offset, ray.d)
        height = dr.maximum(dr.norm(offset - foot * ray.d), 1e-6)
        return cls(foot, height, dr.atan2(near - foot, height), dr.atan2(far - foot, height))

    def sample(self, u: Any) -> Any:
        return self.foot + self.height * dr.tan(dr.lerp(self.low, self.high, u))

    def density(self, distance: Any) -> Any:
        span = (self.high - self.low) * (self.height**2 + dr.square(distance - self.foot))
        return self.height / span
