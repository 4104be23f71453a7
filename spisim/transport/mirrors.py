"""Plane mirrors, panes and smooth coats, by which light reaches an end indirectly.

No walk finds a path that meets a mirror next to both ends, because its density is zero for each
end. A plane mirror shows an end as an image behind it (the method of images). A vertex is connected
to this image as to the end itself, at the length of the unfolded path. A second mirror shows the
image of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self
from weakref import WeakKeyDictionary

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.scene import SceneObject
from spisim.scene.bsdf import Conductor, Dielectric, Mirror, Plastic, ThinPane, fresnel
from spisim.scene.content import surface_content
from spisim.transport.jit import Bool, Float, Hit, Object, Point, Point2, Ray, Sampler, UInt, Vector

#: Maximum number of planes, by area x reflectance, through which vertices are joined to an end.
MAX_PLANES = 64
#: Maximum number of planes for light from end to end; each triangle of a curved mirror is one.
MAX_FACETS = 4096
#: Maximum number of consecutive mirrors next to an end.
MAX_FOLDS = 2
#: Triangles share a plane if their normals and distances from the origin agree to this.
SAME_NORMAL, SAME_POSITION_M = 2e-3, 1e-3


class Plane(NamedTuple):
    """n · x = offset."""

    normal: Vector
    offset_m: Float

    def image(self, point: Point) -> Point:
        """The mirror image of a point."""
        return point - 2 * (dr.dot(self.normal, point) - self.offset_m) * self.normal

    def turned(self, direction: Vector) -> Vector:
        """The mirror image of a direction."""
        return direction - 2 * dr.dot(self.normal, direction) * self.normal

    def holds(self, si: Hit) -> Bool:
        """Whether a surface point belongs to the plane, which other planes may cross there."""
        near = dr.abs(dr.dot(self.normal, si.p) - self.offset_m) < 2 * SAME_POSITION_M
        return near & (dr.abs(dr.dot(self.normal, si.n)) > 1 - SAME_NORMAL**2)


class Fold(NamedTuple):
    """Planes in the order in which a vertex meets them on the way to an end."""

    planes: tuple[Plane, ...]
    met: UInt  # number of planes in use, by lane
    probability: Float  # of drawing these planes

    def image(self, end: Point) -> Point:
        """Image of an end, as the vertex sees it."""
        for number, plane in reversed(list(enumerate(self.planes))):
            end = dr.select(number < self.met, plane.image(end), end)
        return end

    def image_of_vertex(self, vertex: Point) -> Point:
        """Image of the vertex, as the end sees it."""
        for number, plane in enumerate(self.planes):
            vertex = dr.select(number < self.met, plane.image(vertex), vertex)
        return vertex

    def ray_of_vertex(self, ray: Ray) -> Ray:
        """Image of a ray through the vertex, as the end sees it."""
        direction = mi.Vector3f(ray.d)
        for number, plane in enumerate(self.planes):
            direction = dr.select(number < self.met, plane.turned(direction), direction)
        return mi.Ray3f(mi.Point3f(self.image_of_vertex(ray.o)), direction)


class _Planes(NamedTuple):
    """Planes to draw from."""

    normals: Vector
    offsets_m: Float
    middles: Point
    along: Vector  # unit vectors in the planes
    halves_m: Point2  # half sides, along and across, of a rectangle around a plane's mirrors
    strengths: Object  # mi.DiscreteDistribution
    count: UInt

    @classmethod
    def of(cls, planes: Floats, strength: Floats) -> Self:
        normals, offsets_m = mi.Normal3f(planes[:, :3].T), mi.Float(planes[:, 3])
        middles, along = mi.Point3f(planes[:, 4:7].T), mi.Vector3f(planes[:, 7:10].T)
        halves_m, weights = mi.Point2f(planes[:, 10:12].T), mi.Float(strength)
        dr.make_opaque(normals, offsets_m, middles, along, halves_m, weights)
        strengths, count = mi.DiscreteDistribution(weights), dr.opaque(mi.UInt32, len(strength))
        return cls(normals, offsets_m, middles, along, halves_m, strengths, count)

    def plane(self, number: UInt) -> Plane:
        """Plane `number`, by lane."""
        normal = mi.Vector3f(dr.gather(mi.Normal3f, self.normals, number))
        return Plane(normal, dr.gather(mi.Float, self.offsets_m, number))

    def draw(self, uniform: Float) -> tuple[Plane, Float]:
        """A random plane for each lane, and its probability."""
        number, probability = self.strengths.sample_pmf(uniform)
        return self.plane(number), probability

    def shows(self, number: UInt, vertex: Point, image: Point) -> Bool:
        """Whether the line from a vertex to an image crosses the rectangle of a plane's mirrors."""
        plane = self.plane(number)
        before_m = dr.dot(plane.normal, vertex) - plane.offset_m
        behind_m = plane.offset_m - dr.dot(plane.normal, image)
        met = vertex + before_m / (before_m + behind_m) * (image - vertex)
        aside = met - dr.gather(mi.Point3f, self.middles, number)
        along = dr.gather(mi.Vector3f, self.along, number)
        half_m = dr.gather(mi.Point2f, self.halves_m, number) + 2 * SAME_POSITION_M
        within = dr.abs(dr.dot(along, aside)) < half_m.x
        within &= dr.abs(dr.dot(dr.cross(plane.normal, along), aside)) < half_m.y
        return (before_m * behind_m > 0) & within


@dataclass(frozen=True, eq=False)
class Mirrors:
    """Planes that reflect, drawn in proportion to area and reflectance."""

    largest: _Planes
    all: _Planes
    again: Float  # probability that a second one follows
    maximum: int  # maximum number of consecutive planes

    @classmethod
    def of(cls, things: Sequence[SceneObject]) -> Self | None:
        """Mirrors among the objects; None where there are none."""
        planes, strength = _candidate_planes(things) if things else (np.zeros((0, 12)), np.zeros(0))
        if not strength.size:
            return None
        planes, strength = planes.astype(np.float32), strength.astype(np.float32)
        return cls(
            largest=_Planes.of(planes[:MAX_PLANES], strength[:MAX_PLANES]),
            all=_Planes.of(planes, strength),
            again=dr.opaque(mi.Float, _again(things)),
            maximum=min(len(planes), MAX_FOLDS),
        )

    def one(self, number: UInt) -> Fold:
        """Plane `number` of the largest ones."""
        return Fold((self.largest.plane(number),), mi.UInt32(1), mi.Float(1))

    def choose_two(self, sampler: Sampler) -> tuple[Fold, Bool]:
        """Two of the largest planes, and whether to use them, which has probability `again`."""
        looked = sampler.next_1d() < self.again
        planes, chances = zip(
            *(self.largest.draw(sampler.next_1d()) for _ in range(MAX_FOLDS)), strict=True
        )
        return Fold(planes, mi.UInt32(MAX_FOLDS), self.again * dr.prod(chances)), looked

    def choose_any(self, uniform: Float, sampler: Sampler) -> Fold:
        """The first plane drawn from all by `uniform`, the following from the largest, by lane."""
        plane, probability = self.all.draw(uniform)
        planes, met, going = [plane], mi.UInt32(1), mi.Bool(True)
        for _ in range(1, self.maximum):
            on = sampler.next_1d() < self.again
            probability *= dr.select(going, dr.select(on, self.again, 1 - self.again), 1)
            going &= on
            plane, chosen = self.largest.draw(sampler.next_1d())
            planes.append(plane)
            probability *= dr.select(going, chosen, 1)
            met += dr.select(going, 1, 0)
        return Fold(tuple(planes), met, probability)


def mirrors_of(objects: Sequence[SceneObject]) -> tuple[Mirrors | None, Mirrors | None]:
    """Mirrors, smooth metal, glass and panes of a scene; and these together with smooth coats."""
    coats, mirrors = (
        [each for each in objects if isinstance(each.material.bsdf, kinds) and _is_whole(each)]
        for kinds in (Plastic, Mirror | Conductor | Dielectric | ThinPane)
    )
    without_coats = Mirrors.of(mirrors)
    return without_coats, Mirrors.of(coats + mirrors) if coats else without_coats


def _is_whole(thing: SceneObject) -> bool:
    return thing.material.opacity is None


def _reflectance(thing: SceneObject) -> float:
    """Reflectance at normal incidence; of plastic, that of its coat."""
    bsdf = thing.material.bsdf
    if isinstance(bsdf, Plastic):
        return fresnel(bsdf.ior)
    return thing.material.reflectance


def _again(mirrors: Sequence[SceneObject]) -> float:
    """Probability of looking for a second mirror, in proportion to the light that is left."""
    reflectances = [_reflectance(thing) for thing in mirrors]
    areas = [thing.mesh.area * each for thing, each in zip(mirrors, reflectances, strict=True)]
    mean = float(np.average(reflectances, weights=areas))
    return mean / (1 + mean)


def _candidate_planes(mirrors: Sequence[SceneObject]) -> tuple[Floats, Floats]:
    """`_planes` of the mirrors, cached while none of them changes."""
    content = surface_content(mirrors)
    cached = _CACHED.get(mirrors[0])
    if cached is None or cached[0] != content:
        cached = _CACHED[mirrors[0]] = content, _planes(mirrors)
    return cached[1]


#: The most recent planes, by the first of the objects and with the content of all.
_CACHED: WeakKeyDictionary[SceneObject, tuple[bytes, tuple[Floats, Floats]]] = WeakKeyDictionary()


def _planes(things: Sequence[SceneObject]) -> tuple[Floats, Floats]:
    """Unit normals, offsets and rectangles of planes (planes, 12); area x reflectance (planes,)."""
    triangles = np.concatenate([thing.mesh.triangles for thing in things])
    normals = np.concatenate([thing.mesh.face_normals for thing in things])
    strength = np.concatenate([thing.mesh.area_faces * _reflectance(thing) for thing in things])
    planes: list[Floats] = []
    total: list[float] = []
    free = strength > 0
    for largest in np.argsort(-strength, kind="stable"):
        if not free[largest] or len(planes) == MAX_FACETS:
            continue
        normal = normals[largest]
        offset = float(normal @ triangles[largest, 0])
        same = np.flatnonzero(free & (np.abs(normals @ normal) > 1 - SAME_NORMAL**2 / 2))
        flush = np.abs(triangles[same] @ normal - offset).max(axis=1) < SAME_POSITION_M
        same = same[flush | (same == largest)]
        planes.append(np.array([*normal, offset, *_rectangle(triangles[same], normal)]))
        total.append(float(strength[same].sum()))
        free[same] = False
    strongest = np.argsort(-np.array(total), kind="stable")
    return np.array(planes)[strongest], np.array(total)[strongest]


def _rectangle(triangles: Floats, normal: Floats) -> Floats:
    """Rectangle around triangles: middle, direction of the longest edge, half sides, (8,)."""
    edges = (triangles - np.roll(triangles, 1, axis=1)).reshape(-1, 3)
    along = edges[np.argmax((edges**2).sum(axis=1))]
    along = along - (along @ normal) * normal
    along = along / np.linalg.norm(along)
    axes = np.stack([along, np.cross(normal, along)])
    corners = triangles.reshape(-1, 3) @ axes.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = (low + high) / 2 @ axes + (normal @ triangles[0, 0]) * normal
    return np.concatenate([middle, along, (high - low) / 2])
