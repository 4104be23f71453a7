"""Whether a drone can fly in a scene: free space, and surfaces to image and to range."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.scene.bsdf import (
    Conductor,
    Dielectric,
    Mirror,
    RoughConductor,
    RoughDielectric,
    ThinPane,
)
from spisim.scene.materials import Material
from spisim.scene.model import Scene, SceneObject
from spisim.scene.rays import enclosing_object, first_hits, first_met

#: Minimum free space around the drone: its own size and a margin.
CLEARANCE_M = 0.4
#: Minimum distance of surfaces in view.
MIN_DISTANCE_M = 0.9
#: Minimum return of a spot, reflectance times cosine over squared range, 1/m², or as much by
#: another surface: black rubber, head-on, at 7.5 m.
MIN_SPOT_PER_M2 = 1.1e-3
#: Points of a lens that must see the spot: its centre and a ring around it.
ON_LENS = np.array([(0, 0), (-1, 0), (1, 0), (0, -1), (0, 1)])
#: Offset of points from their surface, so that single precision does not shadow them.
OFF_SURFACE_M = 0.001
#: Rays across the field, each way; odd, so that one is on the axis.
RAYS = 11


@dataclass(frozen=True)
class Needs:
    """Needs of a drone that takes images and ranges spots, in the optical frame."""

    half_field_deg: tuple[float, float]  # of the image, across and down
    beams: Floats  # (spots, 3), unit vectors to the spots
    farthest_spot_m: float  # maximum unambiguous range
    min_spots: int  # that must return within it
    detectors_m: Floats  # (spots, 3)
    lens_ring_m: float  # radius that holds half the area of a detector's lens


def layout_problem(scene: Scene, needs: Needs) -> str | None:
    """What makes a scene unfit, in words, or None; see `Layout.problem`."""
    return Layout(scene, needs).problem


def _directions(azimuth_deg: Floats, elevation_deg: Floats) -> Floats:
    """Unit vectors (n, 3) in the optical frame, to the right and up."""
    azimuth, elevation = np.radians([azimuth_deg, elevation_deg])
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), -np.sin(elevation), level * np.cos(azimuth)], axis=1)


_RIGHT, _DOWN = np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)]).T
#: Needs that every draw of a family meets, whatever the instrument.
OFFERED = Needs(
    half_field_deg=(10.0, 10.0),
    beams=_directions(5.0 * _RIGHT, -5.0 * _DOWN),
    farthest_spot_m=9.8,
    min_spots=1,
    detectors_m=np.column_stack([0.007 * _RIGHT, 0.007 * _DOWN, np.zeros(4)]),
    lens_ring_m=0.005,
)


@dataclass(frozen=True, eq=False)
class Layout:
    """A scene around its drone, checked against needs."""

    scene: Scene
    needs: Needs

    @cached_property
    def triangles(self) -> Floats:
        """All triangles (t, 3, 3) in the optical frame."""
        meshes = [thing.mesh for thing in self.scene.objects]
        pose = self.scene.drone_pose
        points = np.concatenate([np.asarray(mesh.vertices) for mesh in meshes])
        firsts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
        faces = [np.asarray(mesh.faces) + n for mesh, n in zip(meshes, firsts, strict=True)]
        return np.asarray(((points - pose[:3, 3]) @ pose[:3, :3])[np.concatenate(faces)])

    @cached_property
    def clearance_m(self) -> float:
        """Distance from the drone to the nearest surface in any direction."""
        return _distance_to(self.triangles)

    @cached_property
    def lost(self) -> dict[int, str]:
        """Spots without a range, by index, and why, in words."""
        lost = {}
        for spot, range_m in enumerate(self._spots):
            if range_m > self.needs.farthest_spot_m:
                lost[spot] = f"meets nothing within {self.needs.farthest_spot_m:.3g} m"
            elif why := self._why_dark(spot):
                lost[spot] = why
        return lost

    @property
    def problem(self) -> str | None:
        """What makes the scene unfit for these needs, in words, or None."""
        if name := enclosing_object(self.scene, self.scene.drone_pose[:3, 3]):
            return f"the drone is inside {name!r}"
        if self.clearance_m < CLEARANCE_M:
            return (
                f"something is {self.clearance_m:.2f} m from the drone, less than {CLEARANCE_M} m"
            )
        if len(self._spots) - len(self.lost) < self.needs.min_spots:
            text = ", ".join(f"spot {spot} {why}" for spot, why in self.lost.items())
            return f"at least {self.needs.min_spots} of the laser spots should return: {text}"
        fields = [np.linspace(-half, half, RAYS) for half in self.needs.half_field_deg]
        field = first_hits(np.zeros(3), _rays(*fields), self.triangles[self._in_view])
        if (near := min(field.min(), self._spots.min())) < MIN_DISTANCE_M:
            return f"the nearest surface in view is at {near:.2f} m, less than {MIN_DISTANCE_M} m"
        return None

    @cached_property
    def _in_view(self) -> NDArray[np.bool_]:
        """Which triangles may be in view."""
        return _may_be_in_view(self.triangles, self.needs)

    @cached_property
    def _ranged(self) -> NDArray[np.int64]:
        """Indices of those in view that spots do not pass."""
        things = self.scene.objects
        stop = np.array([not _is_passed(thing.material) for thing in things], dtype=bool)
        counts = [len(thing.mesh.faces) for thing in things]
        return np.flatnonzero(self._in_view & np.repeat(stop, counts))

    @cached_property
    def _spots(self) -> Floats:
        """Ranges (spots,) of the spots."""
        return first_hits(np.zeros(3), self.needs.beams, self.triangles[self._ranged])

    def _owner(self, triangle: int) -> SceneObject:
        """The object of a triangle."""
        stops = np.cumsum([len(thing.mesh.faces) for thing in self.scene.objects])
        return self.scene.objects[int(np.searchsorted(stops, triangle, side="right"))]

    def _why_dark(self, number: int) -> str | None:
        """Why a spot returns less than a fraction of a white surface at 1 m (1/m²), or None."""
        needs, triangles = self.needs, self.triangles[self._ranged]
        beam = needs.beams[number]
        (distance,), (index,) = first_met(np.zeros(3), beam[None], triangles)
        one, two, three = triangles[index]
        normal = np.cross(two - one, three - one)
        normal *= -np.sign(normal @ beam) / np.linalg.norm(normal)
        spot = distance * beam + OFF_SURFACE_M * normal
        lens = np.tile(needs.detectors_m[number], (len(ON_LENS), 1))
        lens[:, :2] += needs.lens_ring_m * ON_LENS
        between = _along(beam, triangles, float(np.linalg.norm(lens, axis=1).max()))
        seen = np.mean([first_hits(point, (spot - point)[None], between)[0] > 1 for point in lens])
        thing = self._owner(int(self._ranged[index]))
        where = f"on {thing.name!r} ({thing.material.name}) at {distance:.3g} m"
        if seen < 0.5:
            return f"{where} is hidden from its detector"
        returned = seen * straight_back(thing.material, float(-normal @ beam)) / distance**2
        if returned < MIN_SPOT_PER_M2:
            return f"{where} is too faint"
        return None


def _along(beam: Floats, triangles: Floats, within_m: float) -> Floats:
    """Triangles whose bounding spheres come within a distance of a beam."""
    centre = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - centre[:, None], axis=2).max(axis=1)
    aside = np.linalg.norm(np.cross(centre, beam), axis=1)
    return triangles[aside <= radius + within_m + OFF_SURFACE_M]


def _is_passed(material: Material) -> bool:
    """Whether light passes the surface and none comes back."""
    nothing = material.opacity is not None and not np.any(material.opacity)
    return nothing or isinstance(material.bsdf, ThinPane)


def straight_back(material: Material, cosine: float) -> float:
    """Radiance back to the source relative to a white diffuse surface across the light.

    Rough metals return by microfacets that face the source (Walter et al. 2007); what facets
    scatter among themselves is left out, so metals are at least as bright. Retroreflectors
    count by their body alone: the rest depends on the detector's offset.
    """
    match material.bsdf:
        case RoughConductor(roughness=alpha, distribution="beckmann"):
            return material.reflectance * _gaussian_facets(alpha, max(cosine, 1e-6))
        case RoughConductor(roughness=alpha):
            width = cosine**2 * (alpha**2 - 1) + 1
            shadowing = cosine + math.sqrt(alpha**2 + (1 - alpha**2) * cosine**2)
            return material.reflectance * alpha**2 * cosine / (width * shadowing) ** 2
        case Mirror() | Conductor() | Dielectric() | RoughDielectric() | ThinPane():
            return 0.0
    return material.reflectance * cosine


def _gaussian_facets(alpha: float, cosine: float) -> float:
    """For a white metal with Beckmann's distribution and Smith's shadowing both ways."""
    slope = max(math.sqrt(1 - cosine**2) / cosine, 1e-6)
    steep = 1 / (alpha * slope)
    tail = math.exp(-(steep**2)) / (steep * math.sqrt(math.pi))
    unshadowed = 2 / (1 + math.erf(steep) + tail)
    facing = math.exp(-((slope / alpha) ** 2)) / (alpha**2 * cosine**4)
    return facing * unshadowed**2 / (4 * cosine)


def _distance_to(triangles: Floats) -> float:
    """Distance from the origin to the nearest of triangles (t, 3, 3)."""
    a, b, c = np.moveaxis(triangles, 1, 0)  # reductions over an axis of three are slow
    squares = np.minimum.reduce([np.einsum("tk,tk->t", each, each) for each in (a, b, c)])
    corner = np.sqrt(squares)
    edges = np.maximum.reduce([a, b, c]) - np.minimum.reduce([a, b, c])
    size = np.sqrt(np.einsum("tk,tk->t", edges, edges))
    near = triangles[corner - size <= corner.min()]  # no other can be nearest
    closest = trimesh.triangles.closest_point(near, np.zeros((len(near), 3)))
    return float(np.linalg.norm(closest, axis=1).min())


def _may_be_in_view(triangles: Floats, needs: Needs) -> NDArray[np.bool_]:
    """Which triangles (t, 3, 3) in the optical frame are not outside one plane of the field."""
    field = np.tan(np.radians(needs.half_field_deg))
    widest = np.maximum(field, np.abs(needs.beams[:, :2] / needs.beams[:, 2:]).max(axis=0))
    side, top = widest[:, None, None] * triangles[..., 2]
    x, y = triangles[..., 0], triangles[..., 1]
    beside = [x > side, x < -side, y > top, y < -top, triangles[..., 2] < 0]
    whole = [each[:, 0] & each[:, 1] & each[:, 2] for each in beside]
    return np.asarray(~np.logical_or.reduce(whole))


def _rays(right_deg: Floats, down_deg: Floats) -> Floats:
    """Unit rays (n², 3) in the optical frame, at all pairs of angles to the right and down."""
    x, y = np.meshgrid(np.tan(np.radians(right_deg)), np.tan(np.radians(down_deg)))
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
