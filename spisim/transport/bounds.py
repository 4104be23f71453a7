"""Shapes that media fill, with the part of a ray inside each."""

from dataclasses import dataclass
from typing import Protocol

import drjit as dr
import mitsuba as mi

from spisim.transport.jit import Bool, Float, Matrix, Point, Ray


class Bounds(Protocol):
    """A convex region."""

    def interval(self, ray: Ray, far: Float) -> tuple[Float, Float]:
        """Distances (near, far) between which a ray of length `far` is inside, if near < far."""

    def contains(self, point: Point) -> Bool:
        """Whether a point is inside."""


@dataclass(frozen=True, eq=False)
class Ball:
    """A ball, which holds the fog around the scene."""

    centre: Point
    radius_m: Float

    def interval(self, ray: Ray, far: Float) -> tuple[Float, Float]:
        offset = ray.o - self.centre
        middle = -dr.dot(offset, ray.d)
        squared = middle * middle + self.radius_m**2 - dr.squared_norm(offset)
        half = dr.select(squared > 0, dr.sqrt(dr.maximum(squared, 0)), -dr.inf)
        return dr.maximum(middle - half, 0), dr.minimum(middle + half, far)

    def contains(self, point: Point) -> Bool:
        return dr.squared_norm(point - self.centre) <= self.radius_m**2


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """The ball in the unit cube under an affine map."""

    to_local: Matrix

    def interval(self, ray: Ray, far: Float) -> tuple[Float, Float]:
        offset = mi.Vector3f(self.to_local @ mi.Point3f(ray.o)) - 0.5
        step = self.to_local @ mi.Vector3f(ray.d)
        squared = dr.squared_norm(step)
        middle = -dr.dot(offset, step) / squared
        # From the point of the line closest to the centre, which avoids the difference of large
        # numbers.
        beside = dr.squared_norm(offset + middle * step)
        half = dr.select(beside < 0.25, dr.sqrt(dr.maximum(0.25 - beside, 0) / squared), -dr.inf)
        return dr.maximum(middle - half, 0), dr.minimum(middle + half, far)

    def contains(self, point: Point) -> Bool:
        return dr.squared_norm(mi.Vector3f(self.to_local @ mi.Point3f(point)) - 0.5) <= 0.25


@dataclass(frozen=True, eq=False)
class Box:
    """The unit cube under an affine map."""

    to_local: Matrix

    def interval(self, ray: Ray, far: Float) -> tuple[Float, Float]:
        start, step = self.to_local @ mi.Point3f(ray.o), self.to_local @ mi.Vector3f(ray.d)
        step = dr.select(dr.abs(step) < 1e-20, 1e-20, step)
        first, second = -start / step, (1 - start) / step
        near = dr.maximum(dr.max(dr.minimum(first, second)), 0)
        return near, dr.minimum(dr.min(dr.maximum(first, second)), far)

    def contains(self, point: Point) -> Bool:
        local = self.to_local @ mi.Point3f(point)
        return dr.all((local >= 0) & (local <= 1))
