"""Ground truth from the projector's pinhole: what a perfect instrument would measure.

Of a ray that passes through panes or masks it is the surface that sends the most light straight
back. A mirror is where it is, not what it shows.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.depth import CORRIDOR_M
from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene, SceneObject
from spisim.scene.materials import Picture
from spisim.transport.backend import with_backend
from spisim.transport.bsdf import spectrum
from spisim.transport.geometry import rays_of
from spisim.transport.jit import Float, Hit
from spisim.transport.meshes import Meshes
from spisim.transport.raycaster import RAYS_AT_A_TIME
from spisim.transport.sight import brightest, first_distance_m

#: Fields that are nan without an image.
MAPS = ("range_m", "depth_m", "reflectance", "normal", "coverage")
#: Rays per side of a virtual pixel, from which its coverage is counted.
SUBPIXELS = 4
#: Distance between rays along the corridor.
CORRIDOR_STEP_M = 0.02

#: Origins, unit directions, points where their light is received, and the cone that is seen there,
#: its apex, and its axis over the cosine of half its angle, (n, 3) each.
Rays = tuple[Floats, Floats, Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class GroundTruth:
    """Per virtual pixel, along the ray through its centre; nan (id -1) where nothing is hit.

    Parameters
    ----------
    range_m
        Range (H, W) from the pinhole along the ray, m.
    depth_m
        Depth (H, W) along the optical axis, m.
    reflectance
        Reflectance (H, W) at the instrument's wavelength.
    normal
        Unit normal (H, W, 3) in the optical frame, towards the projector.
    object_id
        Index (H, W) into `object_names`.
    coverage
        Fraction (H, W) of the pixel that the object at its centre covers: below 1 at edges and on
        thin objects.
    object_names
        Names of the scene's objects.
    spot_range_m
        Range (spots,) of the surface from which most light of each laser, or of the middle of each
        zone, comes back in clear air, m; nan for none.
    spot_object
        Name (spots,) of its object; None for none.
    corridor_m
        Distance along the optical axis to the first surface in the corridor ahead, panes and nets
        included, m; nan for none.
    pose
        World-from-optical pose (4, 4).
    """

    range_m: NDArray[np.float32]
    depth_m: NDArray[np.float32]
    reflectance: NDArray[np.float32]
    normal: NDArray[np.float32]
    object_id: NDArray[np.int32]
    coverage: NDArray[np.float32]
    object_names: tuple[str, ...]
    spot_range_m: Floats
    spot_object: tuple[str | None, ...]
    corridor_m: float
    pose: Floats


@with_backend
def ground_truth(
    scene: Scene, instrument: Instrument, *, subpixels: int = SUBPIXELS
) -> GroundTruth:
    """Trace the centre of every virtual pixel, the pixels' parts, and the laser beams.

    Parameters
    ----------
    scene, instrument
        The scene, with the pose of the drone, and the instrument that looks at it.
    subpixels
        Rays per side of a pixel from which its coverage is counted; nan coverage for 1.

    Returns
    -------
    GroundTruth
        Maps per virtual pixel, and ranges of the spots.

    Raises
    ------
    InputError
        If the scene was made for another wavelength.
    """
    (truth,) = ground_truths([(scene, instrument)], subpixels=subpixels)
    return truth


@with_backend
def ground_truths(
    views: Sequence[tuple[Scene, Instrument]], *, subpixels: int = SUBPIXELS
) -> list[GroundTruth]:
    """`ground_truth` of several views, traced together where their objects are the same."""
    result: list[GroundTruth] = []
    for _, same in groupby(views, key=lambda view: id(view[0].objects)):
        group = list(same)
        rays = math.prod(InstrumentView.placed(*group[0]).projector.shape)
        step = max(1, RAYS_AT_A_TIME // rays)
        for start in range(0, len(group), step):
            result += _of_the_same(group[start : start + step], subpixels)
    return result


def _of_the_same(views: Sequence[tuple[Scene, Instrument]], subpixels: int) -> list[GroundTruth]:
    """Truths of views of the same objects."""
    objects = views[0][0].objects
    meshes = Meshes.of(objects)
    placed = [InstrumentView.placed(*view) for view in views]
    rays = [
        part for (scene, _), each in zip(views, placed, strict=True) for part in _rays(scene, each)
    ]
    met = _met(objects, meshes, rays).split([len(directions) for _, directions, *_ in rays])
    corridors_m = _corridors_m(meshes, [scene.drone_pose for scene, _ in views])
    return [
        _truth(*view, each, meshes, met[2 * number : 2 * number + 2], corridor_m, subpixels)
        for number, (view, each, corridor_m) in enumerate(
            zip(views, placed, corridors_m, strict=True)
        )
    ]


def _rays(scene: Scene, placed: InstrumentView) -> tuple[Rays, Rays]:
    """Rays through pixels, seen from the pinhole, and of lasers, seen from their detectors."""
    pose = scene.drone_pose
    pixels = _pixel_rays(placed, np.arange(placed.projector.shape[0]), 1) @ pose[:3, :3].T
    pinhole = np.broadcast_to(pose[:3, 3], pixels.shape)
    beams, tof = placed.beams, placed.tof
    # Some part of a lens sees what lies in a cone whose apex is behind it.
    behind_m = math.sqrt(tof.area_m2 / math.pi) / math.tan(max(tof.half_angle_rad, 1e-9))
    apex, axis = tof.positions_m - behind_m * tof.axes, tof.axes / math.cos(tof.half_angle_rad)
    return (
        (pinhole, pixels, pinhole, pinhole, 2 * pixels),
        (beams.origins_m, beams.directions, tof.positions_m, apex, axis),
    )


def _corridors_m(meshes: Meshes, poses: Sequence[Floats]) -> list[float]:
    """Distance along the optical axis of each pose to the first surface; nan for none."""
    across = np.linspace(-CORRIDOR_M / 2, CORRIDOR_M / 2, round(CORRIDOR_M / CORRIDOR_STEP_M) + 1)
    offsets = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
    origins = np.concatenate([pose[:3, 3] + offsets @ pose[:3, :2].T for pose in poses])
    ahead = np.repeat([pose[:3, 2] for pose in poses], len(offsets), axis=0)
    distance_m = first_distance_m(meshes, rays_of(origins, ahead)).numpy()
    first_m = distance_m.astype(np.float64).reshape(len(poses), -1).min(axis=1)
    return [each if math.isfinite(each) else math.nan for each in first_m.tolist()]


class _Met(NamedTuple):
    """What rays meet, each (n, ...): distance, object, normal and reflectance; nan for nothing."""

    distance_m: NDArray[np.float32]
    identity: NDArray[np.int64]  # -1 for nothing
    normal: NDArray[np.float32]
    reflectance: Floats

    def split(self, lengths: Sequence[int]) -> list["_Met"]:
        """Parts of these lengths."""
        ends = np.cumsum(lengths)[:-1]
        return [_Met(*part) for part in zip(*(np.split(each, ends) for each in self), strict=True)]


def _met(objects: Sequence[SceneObject], meshes: Meshes, rays: Sequence[Rays]) -> _Met:
    """What is seen along all rays."""
    origins, directions, *ends = map(np.concatenate, zip(*rays, strict=True))
    point, apex, axis = (mi.Point3f(np.float32(each.T)) for each in ends)
    si = brightest(meshes, rays_of(origins, directions), point, (apex, mi.Vector3f(axis)))
    values = dr.select(si.is_valid(), si.t, dr.nan), meshes.owner(si), si.n, si.uv
    dr.eval(*values)  # at once
    distance_m, owner, normal, uv = (each.numpy() for each in values)
    identity = owner.astype(np.int64)
    reflectance = np.array([*(thing.material.reflectance for thing in objects), np.nan])[identity]
    for number in set(identity.tolist()) - {-1}:
        if (texture := objects[number].material.texture) is not None:
            here = identity == number
            reflectance[here] *= _texture_at(texture, uv[:, here])
    return _Met(distance_m, identity, normal.T.reshape(-1, 3), reflectance)


def _texture_at(texture: Picture, uv: NDArray[np.float32]) -> NDArray[np.float32]:
    """A texture at Mitsuba's coordinates (2, n)."""
    si: Hit = dr.zeros(mi.SurfaceInteraction3f, uv.shape[1])
    si.uv = mi.Point2f(np.ascontiguousarray(uv))
    values: Float = mi.load_dict(spectrum(texture)).eval(si).x
    return np.asarray(values.numpy())


def _truth(
    scene: Scene,
    instrument: Instrument,
    placed: InstrumentView,
    meshes: Meshes,
    met: Sequence[_Met],
    corridor_m: float,
    subpixels: int,
) -> GroundTruth:
    """Truth of a view from what its rays meet."""
    pixels, spots = met
    shape, names = placed.projector.shape, tuple(thing.name for thing in scene.objects)
    local = _pixel_rays(placed, np.arange(shape[0]), 1)
    range_m = pixels.distance_m.reshape(shape)
    normal = pixels.normal @ scene.drone_pose[:3, :3]
    normal *= -np.sign(np.sum(normal * local, axis=1, keepdims=True))
    normal[np.isnan(pixels.distance_m)] = np.nan
    identity = pixels.identity.reshape(shape)
    maps: dict[str, Any] = {
        "range_m": range_m.astype(np.float32),
        "depth_m": (range_m * local[:, 2].reshape(shape)).astype(np.float32),
        "reflectance": pixels.reflectance.reshape(shape).astype(np.float32),
        "normal": normal.reshape(*shape, 3).astype(np.float32),
        "object_id": identity.astype(np.int32),
        "coverage": _coverage(scene, meshes, placed, identity, subpixels).astype(np.float32),
    }
    if not instrument.images:  # the only pixel is a placeholder
        maps |= {name: np.full_like(maps[name], np.nan) for name in MAPS}
    return GroundTruth(
        **maps,
        object_names=names,
        spot_range_m=spots.distance_m.astype(np.float64),
        spot_object=tuple(
            names[number] if number >= 0 else None for number in spots.identity.tolist()
        ),
        corridor_m=corridor_m,
        pose=scene.drone_pose,
    )


def _coverage(
    scene: Scene,
    meshes: Meshes,
    placed: InstrumentView,
    identity: NDArray[np.int64],
    subpixels: int,
) -> Floats:
    """Fraction (H, W) of each pixel's parts that meet the object at its centre; nan for 1 part."""
    if subpixels == 1:
        return np.full(identity.shape, np.nan)
    height, width = identity.shape
    rotation, origin = scene.drone_pose[:3, :3], scene.drone_pose[:3, 3]
    step = max(1, RAYS_AT_A_TIME // (width * subpixels**2))
    bands = []
    for rows in np.split(np.arange(height), range(step, height, step)):
        local = _pixel_rays(placed, rows, subpixels)
        rays = rays_of(origin, local @ rotation.T)
        parts = brightest(meshes, rays, rays.o)
        seen = meshes.object_ids(parts).reshape(len(rows), subpixels, width, subpixels)
        bands.append((seen == identity[rows, None, :, None]).mean(axis=(1, 3)))
    return np.concatenate(bands)


def _pixel_rays(placed: InstrumentView, rows: NDArray[np.int64], parts: int) -> Floats:
    """Unit vectors through the centres of `parts`² parts of each pixel of some rows, (n, 3)."""
    height, width = (side * parts for side in placed.projector.shape)
    fine = (rows[:, None] * parts + np.arange(parts)).ravel()
    x = (2 * (np.arange(width) + 0.5) / width - 1) * placed.projector.tan_half_width
    y = (2 * (fine + 0.5) / height - 1) * placed.projector.tan_half_height
    grid = np.stack([*np.meshgrid(x, y), np.ones((len(fine), width))], axis=-1).reshape(-1, 3)
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))
