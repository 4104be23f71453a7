"""Ground truth from the projector's pinhole: what a perfect instrument would measure."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.depth import CORRIDOR_M
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.geometry import rays_of
from spisim.transport.jit import Hit, Vector
from spisim.transport.meshes import Meshes
from spisim.transport.raycaster import RAYS_AT_A_TIME
from spisim.transport.views import InstrumentView

#: Fields that are nan without an image.
MAPS = ("range_m", "depth_m", "reflectance", "normal", "coverage")
#: Rays per side of a virtual pixel, from which its coverage is counted.
SUBPIXELS = 4
#: Distance between rays along the corridor.
CORRIDOR_STEP_M = 0.02


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
        Range (spots,) of the surface that each laser, or the middle of each zone, meets in clear
        air, m; nan for none.
    spot_object
        Name (spots,) of its object; None for none.
    corridor_m
        Distance along the optical axis to the first surface in the corridor ahead, m; nan for none.
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
    placed = InstrumentView.placed(scene, instrument)
    meshes = Meshes.of(scene.objects)
    height, width = placed.projector.shape
    rows = max(1, RAYS_AT_A_TIME // (width * subpixels**2))
    bands = [
        _band(scene, meshes, placed, np.arange(top, min(top + rows, height)), subpixels)
        for top in range(0, height, rows)
    ]
    names = tuple(thing.name for thing in scene.objects)
    pictures: dict[str, Any] = {
        name: np.concatenate([band[name] for band in bands]) for name in bands[0]
    }
    if not instrument.images:  # the only pixel is a placeholder
        pictures |= {name: np.full_like(pictures[name], np.nan) for name in MAPS}
    return GroundTruth(
        **pictures,
        object_names=names,
        **_spots(scene, meshes, placed, names),
        corridor_m=_corridor_m(meshes, scene.drone_pose),
        pose=scene.drone_pose,
    )


def _spots(
    scene: Scene, meshes: Meshes, placed: InstrumentView, names: tuple[str, ...]
) -> dict[str, Any]:
    """The fields of `GroundTruth` about the lasers."""
    if not len(placed.beams.directions):
        return {"spot_range_m": np.zeros(0), "spot_object": ()}
    spots = meshes.scene.ray_intersect(rays_of(placed.beams.origins_m, placed.beams.directions))
    met = np.where(spots.is_valid().numpy(), spots.t.numpy(), np.nan)
    return {
        "spot_range_m": met.astype(np.float64),
        "spot_object": tuple(
            names[number] if number >= 0 else None for number in meshes.object_ids(spots)
        ),
    }


def _corridor_m(meshes: Meshes, pose: Floats) -> float:
    """Distance to the first surface that rays along the corridor meet; nan for none."""
    across = np.linspace(-CORRIDOR_M / 2, CORRIDOR_M / 2, round(CORRIDOR_M / CORRIDOR_STEP_M) + 1)
    offsets = np.stack(np.meshgrid(across, across), axis=-1).reshape(-1, 2)
    origins = pose[:3, 3] + offsets @ pose[:3, :2].T
    met = meshes.scene.ray_intersect(rays_of(origins, np.broadcast_to(pose[:3, 2], origins.shape)))
    distances = met.t.numpy()[met.is_valid().numpy()]
    return float(distances.min()) if distances.size else np.nan


def _band(
    scene: Scene, meshes: Meshes, placed: InstrumentView, rows: NDArray[np.int64], subpixels: int
) -> dict[str, NDArray[Any]]:
    """The maps of `GroundTruth`, for some rows of pixels."""
    shape = len(rows), placed.projector.shape[1]
    rotation, origin = scene.drone_pose[:3, :3], scene.drone_pose[:3, 3]
    local = _pixel_rays(placed, rows, 1)
    si = meshes.scene.ray_intersect(rays_of(origin, local @ rotation.T))
    hit = si.is_valid().numpy().reshape(shape)
    identity = meshes.object_ids(si).reshape(shape)
    ranges = np.where(hit, si.t.numpy().reshape(shape), np.nan)
    normals = si.n.numpy().T.reshape(-1, 3) @ rotation
    normals *= -np.sign(np.sum(normals * local, axis=1, keepdims=True))
    coverage = np.full(shape, np.nan)
    if subpixels > 1:
        parts = meshes.scene.ray_intersect(
            rays_of(origin, _pixel_rays(placed, rows, subpixels) @ rotation.T)
        )
        seen = meshes.object_ids(parts).reshape(shape[0], subpixels, shape[1], subpixels)
        coverage = (seen == identity[:, None, :, None]).mean(axis=(1, 3))
    return {
        "range_m": ranges.astype(np.float32),
        "depth_m": (ranges * local[:, 2].reshape(shape)).astype(np.float32),
        "reflectance": _reflectance(scene, si, identity),
        "normal": np.where(hit[..., None], normals.reshape(*shape, 3), np.nan).astype(np.float32),
        "object_id": identity.astype(np.int32),
        "coverage": coverage.astype(np.float32),
    }


def _pixel_rays(placed: InstrumentView, rows: NDArray[np.int64], parts: int) -> Floats:
    """Unit vectors through the centres of `parts`² parts of each pixel of some rows, (n, 3)."""
    height, width = (side * parts for side in placed.projector.shape)
    fine = (rows[:, None] * parts + np.arange(parts)).ravel()
    x = (2 * (np.arange(width) + 0.5) / width - 1) * placed.projector.tan_half_width
    y = (2 * (fine + 0.5) / height - 1) * placed.projector.tan_half_height
    grid = np.stack([*np.meshgrid(x, y), np.ones((len(fine), width))], axis=-1).reshape(-1, 3)
    return np.asarray(grid / np.linalg.norm(grid, axis=1, keepdims=True))


def _reflectance(scene: Scene, si: Hit, identity: NDArray[np.int64]) -> NDArray[np.float32]:
    """Reflectance of each pixel's material, its picture included."""
    plain = np.array([*(thing.material.reflectance for thing in scene.objects), np.nan])
    values = plain[identity]
    textured = [n for n, thing in enumerate(scene.objects) if thing.material.texture is not None]
    if textured:
        local: Vector = si.bsdf().eval_diffuse_reflectance(si).x
        pictured = np.isin(identity, textured)
        values[pictured] = local.numpy().reshape(identity.shape)[pictured]
    return values.astype(np.float32)
