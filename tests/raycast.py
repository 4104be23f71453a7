"""Ranges by trimesh's ray casting, in double precision: a second opinion on the ground truth."""

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.ray.ray_triangle import RayMeshIntersector

from spisim.instrument import Instrument
from spisim.scene import Scene

Floats = NDArray[np.float64]


def pixel_ranges(scene: Scene, instrument: Instrument) -> Floats:
    """Range (H, W) along the ray through the centre of each virtual pixel; nan where none."""
    height, width = instrument.projector.shape
    x = (2 * (np.arange(width) + 0.5) / width - 1) * instrument.projector.tan_half_width
    y = (2 * (np.arange(height) + 0.5) / height - 1) * instrument.projector.tan_half_height
    rays = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1).reshape(-1, 3)
    return first_ranges(scene, rays).reshape(height, width)


def first_ranges(scene: Scene, rays: Floats) -> Floats:
    """Distance (n,) from the drone along rays (n, 3) of its optical frame; nan where none."""
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ scene.drone_pose[:3, :3].T
    origin = scene.drone_pose[:3, 3]
    mesh = trimesh.util.concatenate([thing.mesh for thing in _bare(scene)])
    origins = np.broadcast_to(origin, rays.shape)
    caster = RayMeshIntersector(mesh)
    _, ray, places = caster.intersects_id(origins, rays, multiple_hits=True, return_locations=True)
    ranges = np.full(len(rays), np.inf)
    np.minimum.at(ranges, ray, np.linalg.norm(places - origin, axis=1))
    return np.where(np.isfinite(ranges), ranges, np.nan)


def _bare(scene: Scene) -> list:
    """Objects without textures, which trimesh would try to put together."""
    return [
        type(thing)(
            thing.name,
            trimesh.Trimesh(thing.mesh.vertices, thing.mesh.faces, process=False),
            thing.material,
        )
        for thing in scene.objects
    ]
