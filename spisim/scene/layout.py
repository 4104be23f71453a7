"""Whether a scene is one that the instrument can fly in: room around it, and something to see."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray

from spisim.scene.bsdf import (
    Conductor,
    Dielectric,
    Mirror,
    RoughConductor,
    RoughDielectric,
    ThinPane,
)
from spisim.scene.materials import Material
from spisim.scene.model import Floats, Scene
from spisim.scene.rays import enclosing_object, first_hits, hits

#: Free space around the drone, its own size and a bit.
CLEARANCE_M = 0.4
#: Nearest thing in view.
NEAREST_M = (0.9, 10.0)
#: What the four laser beams end on: within the range that its phase tells without doubt.
FARTHEST_SPOT_M = 9.8
#: What a spot must return for its range: reflectance times cosine over squared range, 1/m², or as
#: much by another surface. Black rubber, head-on, at 7.5 m.
FAINTEST_SPOT_PER_M2 = 1.1e-3
#: Where the spots' detectors are, right and down or left and up of the projector: in the diagonals.
DETECTOR_OFFSET_M = 0.007
#: Points of their lens that should see the spot, right and down of its middle; it is 13 mm wide.
LENS_M = np.array([(0, 0), (-0.005, 0), (0.005, 0), (0, -0.005), (0, 0.005)])
#: What is seen is so far off the surface: in single precision light does not get out of a crevice.
OFF_SURFACE_M = 0.001
#: Half the field of view looked at, and azimuth and elevation of the spots: the paper's instrument.
HALF_FIELD_DEG = 10.0
SPOT_DEG = 5.0
#: Rays across the field, each way; odd, so that one goes straight ahead.
RAYS = 11


def layout_problem(scene: Scene) -> str | None:
    """What makes a scene useless to the paper's instrument, in words, or None if nothing does."""
    if name := enclosing_object(scene, scene.drone_pose[:3, 3]):
        return f"the drone is inside {name!r}"
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    triangles = (triangles - scene.drone_pose[:3, 3]) @ scene.drone_pose[:3, :3]
    clearance = _distance_to(triangles)
    if clearance < CLEARANCE_M:
        return f"something is {clearance:.2f} m from the drone, less than {CLEARANCE_M} m"
    in_view = _may_be_in_view(triangles)
    seen = triangles[in_view]
    beams = spot_rays()
    spots = first_hits(np.zeros(3), beams, seen)
    if spots.max() > FARTHEST_SPOT_M:
        return f"a laser spot meets nothing within {FARTHEST_SPOT_M:g} m"
    owners = np.repeat(np.arange(len(scene.objects)), [len(o.mesh.faces) for o in scene.objects])
    materials = [scene.objects[k].material for k in owners[in_view]]
    if min(_returned(beam, seen, materials) for beam in beams) < FAINTEST_SPOT_PER_M2:
        return "a laser spot is too faint, or hidden from its detector"
    field = np.linspace(-HALF_FIELD_DEG, HALF_FIELD_DEG, RAYS)
    nearest = min(first_hits(np.zeros(3), _rays(field), seen).min(), spots.min())
    low, high = NEAREST_M
    if not low <= nearest <= high:
        return f"the nearest surface in view is at {nearest:.2f} m, not {low:g} to {high:g} m"
    return None


def _returned(beam: Floats, triangles: Floats, materials: Sequence[Material]) -> float:
    """What a diffuse surface of reflectance 1 across the beam would return at 1 m is 1; 1/m².

    0 where less than half of the detector sees it. `triangles` (t, 3, 3) in the optical frame.
    """
    distances = hits(np.zeros(3), beam, triangles)
    place = int(distances.argmin())
    one, two, three = triangles[place]
    normal = np.cross(two - one, three - one)
    normal *= -np.sign(normal @ beam) / np.linalg.norm(normal)
    spot = distances[place] * beam + OFF_SURFACE_M * normal
    lens = np.zeros((len(LENS_M), 3))
    lens[:, :2] = LENS_M + DETECTOR_OFFSET_M * np.sign(beam[:2])
    seen = np.mean([first_hits(point, (spot - point)[None], triangles)[0] > 1 for point in lens])
    if seen < 0.5:
        return 0.0
    returned = straight_back(materials[place], float(-normal @ beam))
    return float(seen * returned / distances[place] ** 2)


def straight_back(material: Material, cosine: float) -> float:
    """Radiance straight back to the source, of that of a white diffuse surface across the light.

    Rough metals by their microfacets that face the source (GGX, Walter et al. 2007). Mirrors and
    panes count as dark: what comes back from behind a pane has another range than its truth.
    """
    match material.bsdf:
        case RoughConductor(roughness=alpha):
            width = cosine**2 * (alpha**2 - 1) + 1
            shadowing = cosine + math.sqrt(alpha**2 + (1 - alpha**2) * cosine**2)
            return material.reflectance * alpha**2 * cosine / (width * shadowing) ** 2
        case Mirror() | Conductor() | Dielectric() | RoughDielectric() | ThinPane():
            return 0.0
    return material.reflectance * cosine


def clearance_m(scene: Scene) -> float:
    """Distance from the drone to the nearest surface, all around."""
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    return _distance_to(triangles - scene.drone_pose[:3, 3])


def _distance_to(triangles: Floats) -> float:
    """Distance from the origin to the nearest of triangles (t, 3, 3)."""
    reach = np.linalg.norm(triangles, axis=2).min(axis=1)
    size = np.linalg.norm(np.ptp(triangles, axis=1), axis=1)
    near = triangles[reach - size <= reach.min()]  # no other one can be nearest
    closest = trimesh.triangles.closest_point(near, np.zeros((len(near), 3)))
    return float(np.linalg.norm(closest, axis=1).min())


def _may_be_in_view(triangles: Floats) -> NDArray[np.bool_]:
    """Which triangles (t, 3, 3) in the optical frame are not wholly beside or behind the field."""
    edge = np.tan(np.radians(HALF_FIELD_DEG)) * triangles[..., 2]
    x, y = triangles[..., 0], triangles[..., 1]
    beside = [x > edge, x < -edge, y > edge, y < -edge, triangles[..., 2] < 0]
    return ~np.any([side.all(axis=1) for side in beside], axis=0)


def spot_rays() -> Floats:
    """Unit rays (4, 3) in the optical frame, at the instrument's azimuths and elevations."""
    azimuth, elevation = np.radians(
        [[x, y] for y in (SPOT_DEG, -SPOT_DEG) for x in (-SPOT_DEG, SPOT_DEG)]
    ).T
    level = np.cos(elevation)
    return np.stack([level * np.sin(azimuth), -np.sin(elevation), level * np.cos(azimuth)], axis=1)


def _rays(angles_deg: Floats) -> Floats:
    """Unit rays (n², 3) in the optical frame, at all pairs of angles to the right and down."""
    tangents = np.tan(np.radians(angles_deg))
    x, y = np.meshgrid(tangents, tangents)
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))
