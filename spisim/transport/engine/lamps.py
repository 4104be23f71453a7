"""Steady lamps, which paths from sensors are joined to, hit, or meet on leaving the scene.

A lamp with a size is both joined at a random point and hit by chance; the balance heuristic weighs
the two by their densities per solid angle. Point and parallel lamps can only be joined.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, Self

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.transport.geometry import direction_to
from spisim.transport.jit import Bool, Float, Hit, Matrix, Object, Point, Sampler, UInt, Vector
from spisim.transport.meshes import Meshes


class Lit(NamedTuple):
    """A lamp as seen from a vertex, at a random point of it."""

    towards: Vector  # unit
    gap_m: Float
    irradiance: Float  # on a surface that faces it, W/m², over the density of the draw
    density: Float  # of the draw, 1/sr; infinite where nothing else finds this light


class Met(NamedTuple):
    """Light of a lamp that a path hits."""

    radiance: Float  # W/(m² sr)
    density: Float  # with which a join finds it, 1/sr


class Joined(Protocol):
    """Lamps that vertices are joined to."""

    def seen_from(self, vertex: Point, sampler: Sampler) -> Lit:
        """One random point of them."""


@dataclass(frozen=True, eq=False)
class Parallel:
    """Light from one direction."""

    irradiance: Float  # W/m²
    direction: Vector  # of the light, unit
    distance_m: Float  # beyond everything in the scene

    def seen_from(self, vertex: Point, sampler: Sampler) -> Lit:
        return Lit(-self.direction, self.distance_m, self.irradiance, mi.Float(dr.inf))


@dataclass(frozen=True, eq=False)
class Points:
    """Point lamps, drawn in proportion to their power."""

    positions: Point
    axes: Vector
    intensities: Float  # W/sr on the axis
    beams: Float  # rad from the axis: full intensity up to here,
    cutoffs: Float  # falling linearly to 0 at this angle
    choice: Object  # mi.DiscreteDistribution

    @classmethod
    def of(
        cls, positions: Floats, axes: Floats, intensities: Floats, angles: Floats, powers: Floats
    ) -> Self:
        """From arrays of n lamps: (n, 3), (n, 3), (n,), beams and cutoffs (n, 2), (n,)."""
        weights = mi.Float(np.float32(powers / powers.sum()))
        points, headings = mi.Point3f(np.float32(positions.T)), mi.Vector3f(np.float32(axes.T))
        strengths = mi.Float(np.float32(intensities))
        beams, cutoffs = (mi.Float(np.float32(each)) for each in angles.T)
        dr.make_opaque(points, headings, strengths, beams, cutoffs, weights)
        choice = mi.DiscreteDistribution(weights)
        return cls(points, headings, strengths, beams, cutoffs, choice)

    def choose(self, sampler: Sampler) -> tuple[UInt, Point]:
        """Index and position of a lamp."""
        number = self.choice.sample(sampler.next_1d())
        return number, dr.gather(mi.Point3f, self.positions, number)

    def seen_from(self, vertex: Point, sampler: Sampler) -> Lit:
        number, position = self.choose(sampler)
        return self.chosen_from(number, position, vertex)

    def chosen_from(self, number: UInt, position: Point, vertex: Point) -> Lit:
        """Lamp `number`, seen from a vertex."""
        towards, gap_m = direction_to(vertex, position)
        axis, intensity = (
            dr.gather(kind, values, number)
            for kind, values in ((mi.Vector3f, self.axes), (mi.Float, self.intensities))
        )
        beam, cutoff = (
            dr.gather(mi.Float, values, number) for values in (self.beams, self.cutoffs)
        )
        angle = dr.safe_acos(-dr.dot(axis, towards))
        slope = (cutoff - angle) / dr.maximum(cutoff - beam, 1e-9)
        falloff = dr.select(angle <= beam, 1, dr.clip(slope, 0, 1))
        fraction = self.choice.eval_pmf_normalized(number)
        irradiance = intensity * falloff / (fraction * gap_m * gap_m)
        return Lit(towards, gap_m, irradiance, mi.Float(dr.inf))


@dataclass(frozen=True, eq=False)
class Areas:
    """Triangles that shine on their front, drawn in proportion to their power."""

    meshes: Meshes
    radiances: Float  # of each triangle of the meshes, W/(m² sr)
    corners: Point  # of the triangles that shine
    edges: tuple[Vector, Vector]
    choice: Object  # mi.DiscreteDistribution
    total: Float  # Σ radiance · area

    @classmethod
    def of(cls, meshes: Meshes, radiances: NDArray[np.float32], triangles: Floats) -> Self:
        """From radiances of all triangles, and corners (n, 3, 3) of those that shine."""
        corner, second, third = np.moveaxis(triangles, 1, 0)
        edges = second - corner, third - corner
        areas = np.linalg.norm(np.cross(*edges), axis=1) / 2
        strengths = areas * radiances[radiances > 0]
        weights = mi.Float(np.float32(strengths / strengths.sum()))
        table = mi.Float(radiances)
        points = mi.Point3f(np.float32(corner.T))
        sides = tuple(mi.Vector3f(np.float32(edge.T)) for edge in edges)
        dr.make_opaque(weights, table, points, *sides)
        total = dr.opaque(mi.Float, float(strengths.sum()))
        choice = mi.DiscreteDistribution(weights)
        return cls(meshes, table, points, (sides[0], sides[1]), choice, total)

    def seen_from(self, vertex: Point, sampler: Sampler) -> Lit:
        number = self.choice.sample(sampler.next_1d())
        uv = mi.warp.square_to_uniform_triangle(sampler.next_2d())
        first, second = (dr.gather(mi.Vector3f, edge, number) for edge in self.edges)
        corner = dr.gather(mi.Point3f, self.corners, number)
        towards, gap_m = direction_to(vertex, corner + first * uv.x + second * uv.y)
        cosine = -dr.dot(dr.normalize(dr.cross(first, second)), towards)
        irradiance = dr.select(cosine > 0, self.total * cosine / (gap_m * gap_m), 0)
        fraction = self.choice.eval_pmf_normalized(number)
        area = 0.5 * dr.norm(dr.cross(first, second))
        density = fraction / area * gap_m * gap_m / dr.maximum(cosine, 1e-9)
        return Lit(towards, gap_m, irradiance, density)

    def met(self, before: Point, si: Hit, active: Bool) -> Met:
        """Light that a path from `before` hits at a surface."""
        number = self.meshes.triangle(si, active)
        facing = si.wi.z > 0
        radiance = dr.gather(mi.Float, self.radiances, number, active & facing)
        gap2 = dr.squared_norm(si.p - before)
        density = radiance / self.total * gap2 / dr.maximum(si.wi.z, 1e-9)
        return Met(radiance, density)


@dataclass(frozen=True, eq=False)
class Uniform:
    """Uniform light from all around, met by paths that leave: no draw does better."""

    radiance: Float

    def met(self, direction: Vector) -> Met:
        """Light that a path meets on leaving in a direction."""
        return Met(self.radiance, mi.Float(0))


@dataclass(frozen=True, eq=False)
class Surround:
    """A picture of all around: rows from its own +z to -z, columns from x by y."""

    shape: tuple[int, int]
    picture: Object  # mi.Texture2f, padded by a column on either side
    choice: Object  # mi.DiscreteDistribution
    to_world: Matrix
    to_local: Matrix
    distance_m: Float

    @classmethod
    def of(cls, radiance: NDArray[np.floating], to_world: Floats, distance_m: float) -> Self:
        """From the radiance (h, w) and axes (3, 3)."""
        height, width = radiance.shape
        padded = np.pad(radiance, ((0, 0), (1, 1)), mode="wrap").astype(np.float32)
        texture: Object = mi.Texture2f
        picture = texture(
            mi.TensorXf(padded[..., None]),
            wrap_mode=dr.WrapMode.Clamp,
            filter_mode=dr.FilterMode.Linear,
        )
        edges = np.cos(np.linspace(0, np.pi, height + 1))
        strengths = radiance * (edges[:-1] - edges[1:])[:, None]
        weights = mi.Float(np.float32(strengths / strengths.sum()).ravel())
        turn, back = (mi.Matrix3f(np.float32(each)) for each in (to_world, to_world.T))
        dr.make_opaque(weights, turn, back)
        choice = mi.DiscreteDistribution(weights)
        far = dr.opaque(mi.Float, distance_m)
        return cls((height, width), picture, choice, turn, back, far)

    def seen_from(self, vertex: Point, sampler: Sampler) -> Lit:
        height, width = self.shape
        cell, square = self.choice.sample(sampler.next_1d()), sampler.next_2d()
        top, below = (dr.cos(dr.pi / height * mi.Float(cell // width + k)) for k in (0, 1))
        cosine = dr.lerp(top, below, square.y)
        azimuth = dr.two_pi / width * (mi.Float(cell % width) + square.x)
        sine, (up, along) = dr.safe_sqrt(1 - cosine * cosine), dr.sincos(azimuth)
        towards = self.to_world @ mi.Vector3f(sine * along, sine * up, cosine)
        met = self.met(towards)
        irradiance = dr.select(met.density > 0, met.radiance / met.density, 0)
        return Lit(towards, self.distance_m, irradiance, met.density)

    def met(self, direction: Vector) -> Met:
        """Light that a path meets on leaving in a direction."""
        height, width = self.shape
        local = self.to_local @ direction
        azimuth = dr.atan2(local.y, local.x) * dr.inv_two_pi
        u = dr.select(azimuth < 0, azimuth + 1, azimuth)
        v = dr.safe_acos(local.z) * dr.inv_pi
        radiance = self.picture.eval(mi.Point2f((u * width + 1) / (width + 2), v))[0]
        row = dr.minimum(mi.UInt32(v * height), height - 1)
        column = dr.minimum(mi.UInt32(u * width), width - 1)
        top, below = (dr.cos(dr.pi / height * mi.Float(row + k)) for k in (0, 1))
        fraction = self.choice.eval_pmf_normalized(row * width + column)
        return Met(radiance, fraction * width * dr.inv_two_pi / (top - below))


@dataclass(frozen=True, eq=False)
class Lamps:
    """All lamps of a scene, by how paths find them."""

    parallel: tuple[Parallel, ...] = ()
    points: Points | None = None
    areas: Areas | None = None
    around: tuple[Uniform | Surround, ...] = ()

    @property
    def joined(self) -> tuple[Joined, ...]:
        """All lamps that vertices are joined to, except for points."""
        pictures = (each for each in self.around if isinstance(each, Surround))
        areas = () if self.areas is None else (self.areas,)
        return (*self.parallel, *areas, *pictures)
