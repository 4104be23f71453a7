"""Plane mirrors and panes, by which light reaches an end that its last scattering does not see.

A path that meets a mirror next to both ends is found by no walk: each is a density of zero for the
other. A plane mirror shows an end as an image behind it (the method of images), so that a vertex
can be connected to the image as it is to the end itself, at the length of the unfolded path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.arrays import Floats
from spisim.scene import SceneObject
from spisim.scene.bsdf import Conductor, Dielectric, Mirror, ThinPane
from spisim.scene.content import surface_content
from spisim.transport.geometry import Geometry
from spisim.transport.media import Media

#: Largest planes (area x reflectance) that images are looked for in; curved mirrors have more.
MAX_PLANES = 64
#: Triangles lie in one plane if their normals and distances from the origin agree to this.
SAME_NORMAL, SAME_PLACE_M = 2e-3, 1e-3


class Plane(NamedTuple):
    """n · x = offset, drawn with a probability."""

    normal: Any
    offset_m: Any
    probability: Any

    def image(self, point: Any) -> Any:
        """The mirror image of a point."""
        return point - 2 * (dr.dot(self.normal, point) - self.offset_m) * self.normal

    def holds(self, si: Any) -> Any:
        """Whether a place on a surface belongs to the plane: it may cross others there."""
        near = dr.abs(dr.dot(self.normal, si.p) - self.offset_m) < 2 * SAME_PLACE_M
        return near & (dr.abs(dr.dot(self.normal, si.n)) > 1 - SAME_NORMAL**2)


@dataclass(frozen=True, eq=False)
class Mirrors:
    """Planes that reflect, drawn as often as they are large and bright."""

    normals: Any
    offsets_m: Any
    planes: Any  # mi.DiscreteDistribution

    @classmethod
    def of(cls, objects: Sequence[SceneObject]) -> Mirrors | None:
        """Those of a scene; None where nothing mirrors."""
        mirrors = [thing for thing in objects if _mirrors(thing)]
        planes, strength = _known_planes(mirrors) if mirrors else (np.zeros((0, 4)), np.zeros(0))
        if not strength.size:
            return None
        planes = planes.astype(np.float32)
        normals, offsets_m = mi.Normal3f(planes[:, :3].T), mi.Float(planes[:, 3])
        weights = mi.Float(strength.astype(np.float32))
        dr.make_opaque(normals, offsets_m, weights)
        return cls(normals, offsets_m, mi.DiscreteDistribution(weights))

    def choose(self, sampler: Any) -> Plane:
        """One plane for each lane."""
        number, probability = self.planes.sample_pmf(sampler.next_1d())
        normal = dr.gather(mi.Normal3f, self.normals, number)
        return Plane(mi.Vector3f(normal), dr.gather(mi.Float, self.offsets_m, number), probability)


def reflected(
    geometry: Geometry,
    media: Media,
    plane: Plane,
    ray: Any,
    length_m: Any,
    sampler: Any,
    active: Any,
) -> Any:
    """Fraction of light that follows a ray to the mirror of a plane, and from there to an end.

    `length_m` is that of the whole path, unfolded. Nothing but fog may lie before the mirror.
    """
    si = geometry.scene.ray_intersect(ray, active)
    met = active & si.is_valid() & (si.t < length_m) & plane.holds(si)
    # The first choice of every mirror and pane is to reflect.
    sample, weight = si.bsdf().sample(
        mi.BSDFContext(mi.TransportMode.Importance), si, mi.Float(0), mi.Point2f(0.5), met
    )
    met &= mi.has_flag(sample.sampled_type, mi.BSDFFlags.DeltaReflection)
    away, rest_m = si.to_world(sample.wo), length_m - si.t
    through = geometry.transmission(si, si.p, away, rest_m, mi.Bool(False), met)
    through *= media.transmittance(ray.o, ray.d, si.t, sampler, through > 0)
    through *= media.transmittance(si.p, away, rest_m, sampler, through > 0)
    return dr.select(met, weight.x * sample.pdf * through, 0)


def _mirrors(thing: SceneObject) -> bool:
    # Coats of gloss reflect 4 %, both ways together 0.2 % of what a mirror does.
    smooth = isinstance(thing.material.bsdf, Mirror | Conductor | Dielectric | ThinPane)
    return smooth and thing.material.opacity is None


def _known_planes(mirrors: Sequence[SceneObject]) -> tuple[Floats, Floats]:
    """See `_planes`; those found last, as long as nothing about the objects changed."""
    content = surface_content(mirrors)
    known = _KEPT.get(mirrors[0])
    if known is None or known[0] != content:
        _KEPT.clear()
        known = _KEPT[mirrors[0]] = content, _planes(mirrors)
    return known[1]


#: The planes found last, by the first of the objects.
_KEPT: WeakKeyDictionary[SceneObject, tuple[bytes, tuple[Floats, Floats]]] = WeakKeyDictionary()


def _planes(things: Sequence[SceneObject]) -> tuple[Floats, Floats]:
    """Unit normal and offset (planes, 4) of those that triangles lie in, and area x reflectance."""
    triangles = np.concatenate([thing.mesh.triangles for thing in things])
    normals = np.concatenate([thing.mesh.face_normals for thing in things])
    strength = np.concatenate(
        [thing.mesh.area_faces * thing.material.reflectance for thing in things]
    )
    left = np.argsort(-strength, kind="stable")
    left = left[strength[left] > 0]
    found: list[Floats] = []
    total: list[float] = []
    while left.size and len(found) < 4 * MAX_PLANES:
        normal = normals[left[0]]
        offset = float(normal @ triangles[left[0], 0])
        aligned = np.abs(normals[left] @ normal) > 1 - SAME_NORMAL**2 / 2
        flush = np.abs(triangles[left] @ normal - offset).max(axis=1) < SAME_PLACE_M
        same = aligned & flush
        same[0] = True
        found.append(np.append(normal, offset))
        total.append(float(strength[left[same]].sum()))
        left = left[~same]
    strongest = np.argsort(-np.array(total), kind="stable")[:MAX_PLANES]
    return np.array(found)[strongest], np.array(total)[strongest]
