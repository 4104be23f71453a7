"""A scene described for Mitsuba's own integrators: surfaces, bounded volumes, emitters."""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from spisim.atmosphere import Atmosphere
from spisim.scene import Scene, Volume
from spisim.scene.lamps import AreaLamp, DirectionalLamp, EnvironmentLamp, Lamp, PointLamp
from spisim.transport.jit import Object
from spisim.transport.media import phase_plugin
from spisim.transport.meshes import mesh_shape, shape, shapes

#: Mitsuba's environment pictures have y up, and azimuths that run the other way.
OURS_FROM_ENVIRONMENT = np.array([[0, 0, -1, 0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
#: Their rows lie on the edges of ours: resampled linearly to more rows and columns, they match.
ROWS, COLUMNS = 8, 3


def reference_scene(scene: Scene, watts_per_klm: float) -> dict[str, Any]:
    """Surfaces, volumes and lamps by name; needs an active variant."""
    alone: dict[str, dict[str, Any]] = {}
    described: dict[str, Any] = {}
    for number, volume in enumerate(scene.volumes):
        medium = mi.load_dict(volume_dict(volume))
        if volume.carrier is not None:
            alone.setdefault(volume.carrier.name, {})["interior"] = medium
        else:
            described[f"volume_{number}"] = _bounded(volume, medium)
    for number, lamp in enumerate(scene.lamps):
        emitter = _emitter(lamp, watts_per_klm)
        if isinstance(lamp, AreaLamp):
            alone.setdefault(lamp.object, {})["emitter"] = mi.load_dict(emitter)
        else:
            described[f"lamp_{number}"] = emitter
    things = {thing.name: thing for thing in scene.objects}
    own = {f"own_{name}": shape([things[name]], **parts) for name, parts in alone.items()}
    rest = [thing for thing in scene.objects if thing.name not in alone]
    return {**described, **shapes(rest), **own}


def medium_dict(medium: Atmosphere, extinction: Any) -> dict[str, Any]:
    """A medium whose extinction is a number or the description of a grid."""
    return {
        "type": "heterogeneous" if isinstance(extinction, dict) else "homogeneous",
        "sigma_t": extinction,
        "albedo": medium.albedo,
        "phase": phase_plugin(medium.phase),
        "has_spectral_extinction": False,
    }


def volume_dict(volume: Volume) -> dict[str, Any]:
    """The medium of a volume."""
    extinction: Any = volume.medium.extinction_per_m
    if volume.density is not None:
        extinction = {
            "type": "gridvolume",
            "grid": mi.VolumeGrid(volume.density[..., None] * np.float32(extinction)),
            "to_world": mi.ScalarTransform4f(volume.to_world.tolist()),
            "wrap_mode": "clamp",
            "raw": True,
        }
    return medium_dict(volume.medium, extinction)


def _bounded(volume: Volume, medium: Object) -> Any:
    """Shape around a volume: Mitsuba's cube and sphere span [-1, 1]³, its grids and ours [0,
    1]³.
    """
    if volume.shape == "box" or volume.shape == "ball":
        pose = volume.to_world @ np.diag([0.5, 0.5, 0.5, 1.0])
        pose[:3, 3] += volume.to_world[:3, :3] @ [0.5, 0.5, 0.5]
        kind = "cube" if volume.shape == "box" else "sphere"
        to_world = mi.ScalarTransform4f(pose.tolist())
        return {"type": kind, "to_world": to_world, "bsdf": {"type": "null"}, "interior": medium}
    return mesh_shape([volume.shape], mi.load_dict({"type": "null"}), {"interior": medium})


def _emitter(lamp: Lamp, watts_per_klm: float) -> dict[str, Any]:
    match lamp:
        case AreaLamp():
            return {"type": "area", "radiance": lamp.radiance.in_band(watts_per_klm)}
        case PointLamp():
            intensity = lamp.intensity.in_band(watts_per_klm)
            if lamp.cutoff_rad == np.pi:
                return {"type": "point", "position": lamp.position_m, "intensity": intensity}
            position = np.asarray(lamp.position_m)
            beside = np.eye(3)[np.argmin(np.abs(lamp.direction))]
            look = mi.ScalarTransform4f().look_at(
                origin=position.tolist(),
                target=(position + lamp.direction).tolist(),
                up=beside.tolist(),
            )
            return {
                "type": "spot",
                "to_world": look,
                "intensity": intensity,
                "cutoff_angle": float(np.degrees(lamp.cutoff_rad)),
                "beam_width": float(np.degrees(lamp.beam_rad)),
            }
        case DirectionalLamp():
            irradiance = lamp.irradiance.in_band(watts_per_klm)
            return {"type": "directional", "direction": lamp.direction, "irradiance": irradiance}
        case EnvironmentLamp(picture=None):
            return {"type": "constant", "radiance": lamp.radiance.in_band(watts_per_klm)}
        case EnvironmentLamp(picture=picture):
            assert picture is not None
            turn = np.eye(4)
            turn[:3, :3] = lamp.to_world
            values = lamp.radiance.in_band(watts_per_klm) * _resampled(picture)
            return {
                "type": "envmap",
                "bitmap": mi.Bitmap(np.repeat(values[..., None], 3, axis=2)),
                "to_world": mi.ScalarTransform4f((turn @ OURS_FROM_ENVIRONMENT).tolist()),
            }


def _resampled(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """Picture with rows on the edges, and columns from right to left."""
    height, width = picture.shape
    rows = np.arange(ROWS * height + 1) / ROWS - 0.5
    columns = (np.arange(COLUMNS * width) + 0.5) / COLUMNS - 0.5
    padded = np.pad(picture, ((0, 0), (1, 1)), mode="wrap")
    grid = np.meshgrid(np.clip(rows, 0, height - 1), columns + 1, indexing="ij")
    values = map_coordinates(padded.astype(np.float64), grid, order=1, mode="nearest")
    return np.ascontiguousarray(values[:, ::-1], dtype=np.float32)
