"""Plane mirrors and panes, by which light reaches an end that its last scattering does not see.

A path that meets a mirror next to both ends is found by no walk: each is a density of zero for the
other. A plane mirror shows an end as an image behind it (the method of images), so that a vertex
can be connected to the image as it is to the end itself, at the length of the unfolded path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.arrays import Floats
from spisim.scene import SceneObject
from spisim.scene.bsdf import Conductor, Dielectric, Mirror, ThinPane
from spisim.transport.geometry import Geometry
from spisim.transport.media import Media

#: Largest planes (area x reflectance) that images are looked for in; curved mirrors have more.
MAX_PLANES = 64
#: Triangles lie in one plane if their normals and distances from the origin agree to this.
SAME_NORMAL, SAME_PLACE_M = 1e-4, 1e-3


class Plane(NamedTuple):
    """n · x = offset, drawn with a probability."""

    normal: Any
    offset_m: Any
    probability: Any

    def image(self, point: Any) -> Any:
        """The mirror image of a point."""
        return point - 2 * (dr.dot(self.normal, point) - self.offset_m) * self.normal

    def holds(self, point: Any) -> Any:
        """Whether a point lies in the plane, to single precision."""
        return dr.abs(dr.dot(self.normal, point) - self.offset_m) < 2 * SAME_PLACE_M


@dataclass(frozen=True, eq=False)
class Mirrors:
    """Planes that reflect, drawn as often as they are large and bright."""

    normals: Any
    offsets_m: Any
    planes: Any  # mi.DiscreteDistribution

    @classmethod
    def of(cls, objects: Sequence[SceneObject]) -> Mirrors | None:
        """Those of a scene; None where nothing mirrors."""
        found = [_planes(thing) for thing in objects if _mirrors(thing)]
        if not found:
            return None
        every = np.concatenate(found)
        grain = [SAME_NORMAL, SAME_NORMAL, SAME_NORMAL, SAME_PLACE_M]
        _, first, group = np.unique(
            np.round(every[:, :4] / grain), axis=0, return_index=True, return_inverse=True
        )
        strength = np.bincount(group.ravel(), every[:, 4])
        kept = np.argsort(-strength, kind="stable")[:MAX_PLANES]
        planes, strength = every[first[kept], :4].astype(np.float32), strength[kept]
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
    met = active & si.is_valid() & (si.t < length_m) & plane.holds(si.p)
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


def _planes(thing: SceneObject) -> Floats:
    """Unit normal, offset and area x reflectance of each triangle, (triangles, 5)."""
    normals, area = thing.mesh.face_normals, thing.mesh.area_faces
    largest = np.abs(normals).argmax(axis=1)
    side = np.sign(np.take_along_axis(normals, largest[:, None], axis=1))
    normals = normals * side  # both sides are one plane
    offsets = np.sum(normals * thing.mesh.triangles[:, 0], axis=1)
    strength = area * thing.material.reflectance
    return np.column_stack([normals, offsets, strength])[strength > 0]
