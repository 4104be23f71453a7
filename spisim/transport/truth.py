"""Ground truth from the projector's pinhole: what a perfect instrument would measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.errors import InputError
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.views import Floats, InstrumentView
from spisim.transport.world import build_world


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Per virtual pixel, along the ray through its centre; nan (id -1) where nothing is hit.

    `normal` is in the optical frame. Spots: the surface each laser meets in clear air.
    """

    range_m: NDArray[np.float32]  # (H, W), from the pinhole along the ray
    depth_m: NDArray[np.float32]  # (H, W), along the optical axis
    reflectance: NDArray[np.float32]  # (H, W)
    normal: NDArray[np.float32]  # (H, W, 3)
    object_id: NDArray[np.int32]  # (H, W), index into `object_names`
    object_names: tuple[str, ...]
    spot_range_m: Floats  # (4,)
    spot_object: tuple[str, ...]  # (4,)


@with_backend
def ground_truth(scene: Scene, instrument: Instrument) -> GroundTruth:
    """Trace the centre of every virtual pixel and the four laser beams.

    Raises
    ------
    InputError
        If a laser beam hits nothing.
    """
    world = build_world(scene)
    placed = InstrumentView.of(instrument, scene.drone_pose)
    rotation, origin = scene.drone_pose[:3, :3], scene.drone_pose[:3, 3]

    local = _pixel_rays(placed)
    si = _trace(world.geometry, origin, local @ rotation.T)
    shape = placed.projector.shape
    hit = si.is_valid().numpy().reshape(shape)
    ranges = np.where(hit, si.t.numpy().reshape(shape), np.nan)
    normals = si.n.numpy().T.reshape(-1, 3) @ rotation
    normals *= -np.sign(np.sum(normals * local, axis=1, keepdims=True))
    names = np.array([thing.name for thing in scene.objects])
    reflectances = np.array([thing.material.reflectance for thing in scene.objects])
    identity = np.where(hit, _object_ids(world.geometry, si).reshape(shape), -1)

    spots = _trace(world.geometry, origin, placed.beams.directions)
    spot_hit = spots.is_valid().numpy()
    if not spot_hit.all():
        missing = int(np.flatnonzero(~spot_hit)[0])
        azimuth, elevation = instrument.lasers.directions_deg[missing]
        raise InputError(
            f"scene {scene.name!r}: laser spot {missing + 1} (lasers.directions_deg "
            f"[{azimuth:g}, {elevation:g}]) hits nothing; every spot must meet a surface: turn "
            "the drone, move the spot or put something behind it"
        )
    return GroundTruth(
        range_m=ranges.astype(np.float32),
        depth_m=(ranges * local[:, 2].reshape(shape)).astype(np.float32),
        reflectance=np.where(hit, reflectances[identity], np.nan).astype(np.float32),
        normal=np.where(hit[..., None], normals.reshape(*shape, 3), np.nan).astype(np.float32),
        object_id=identity.astype(np.int32),
        object_names=tuple(names.tolist()),
        spot_range_m=np.asarray(spots.t.numpy(), dtype=np.float64),
        spot_object=tuple(names[_object_ids(world.geometry, spots)].tolist()),
    )


def _pixel_rays(placed: InstrumentView) -> Floats:
    """Unit vectors through the pixel centres, optical frame, (H·W, 3)."""
    height, width = placed.projector.shape
    x = (2 * (np.arange(width) + 0.5) / width - 1) * placed.projector.tan_half_width
    y = (2 * (np.arange(height) + 0.5) / height - 1) * placed.projector.tan_half_height
    grid = np.stack([*np.meshgrid(x, y), np.ones((height, width))], axis=-1).reshape(-1, 3)
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))


def _trace(geometry: Any, origin: Floats, directions: Floats) -> Any:
    ray = mi.Ray3f(
        mi.Point3f(origin.astype(np.float32)),
        mi.Vector3f(directions.T.astype(np.float32)),
    )
    return geometry.ray_intersect(ray)


def _object_ids(geometry: Any, si: Any) -> NDArray[np.int64]:
    registry = {
        int(_registry_ids(mi.ShapePtr(shape))[0]): number
        for number, shape in enumerate(geometry.shapes())
    }
    return np.array([registry.get(int(number), 0) for number in _registry_ids(si.shape)])


def _registry_ids(shapes: Any) -> Any:
    """Dr.Jit's number of each shape that an array of pointers points to, (lanes,)."""
    pointers: Any = dr.reinterpret_array(mi.UInt32, shapes)
    return pointers.numpy()
