"""Equi-angular sampling along a ray (Kulla & Fajardo, EGSR 2012)."""

from __future__ import annotations

from typing import NamedTuple

import drjit as dr

from spisim.transport.jit_types import Float, Point, Ray


class EquiAngular(NamedTuple):
    """Distances along a ray, uniform in the angle under which a point sees them."""

    foot: Float  # distance of the point's foot on the ray
    height: Float  # of the point above the ray
    low: Float
    high: Float

    @classmethod
    def about(cls, point: Point, ray: Ray, far: Float, near: Float = 0.0) -> EquiAngular:
        offset = point - ray.o
        foot = dr.dot(offset, ray.d)
        height = dr.maximum(dr.norm(offset - foot * ray.d), 1e-6)
        return cls(foot, height, dr.atan2(near - foot, height), dr.atan2(far - foot, height))

    def sample(self, u: Float) -> Float:
        return self.foot + self.height * dr.tan(dr.lerp(self.low, self.high, u))

    def density(self, distance: Float) -> Float:
        span = (self.high - self.low) * (self.height**2 + dr.square(distance - self.foot))
        return self.height / span
