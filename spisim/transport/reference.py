"""Mitsuba's own integrators on the same scene: one render per pattern.

Nothing here shares the two-ended estimator: `volpath` finds the light, Mitsuba's `projector`
emits the patterns. That makes it the oracle of the tests and the baseline of the benchmarks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.bsdf import is_null_transmitting
from spisim.transport.engine.ends import Detectors
from spisim.transport.meshes import shapes
from spisim.transport.phase import phase_plugin
from spisim.transport.views import DetectorView, ProjectorView
from spisim.transport.world import fog_ball

#: Deep enough that what is cut off cannot be measured; roulette ends paths long before.
MAX_DEPTH = 256
#: Mitsuba's cameras and projectors have x to the left and y up; the optical frame has neither.
MITSUBA_FROM_OPTICAL = np.diag([-1.0, -1.0, 1.0, 1.0])


class Renderer:
    """A scene with emitters, lit and seen through its fog by Mitsuba's `volpath`."""

    def __init__(self, scene: Scene, emitters: dict[str, Any]) -> None:
        description: dict[str, Any] = {"type": "scene", **shapes(scene.objects), **emitters}
        fog, boundary = _medium(scene)
        self._around = None  # the medium that the instrument is in
        if boundary is not None:
            description["fog"] = boundary
            if scene.volumes == ():
                self._around = fog
                for name, emitter in emitters.items():
                    description[name] = {**emitter, "medium": fog}
        self.scene = mi.load_dict(description)
        self.parameters = mi.traverse(self.scene)
        # Only volpath connects a path to the emitter through panes and masks.
        clear = fog is None and not any(
            is_null_transmitting(thing.material) for thing in scene.objects
        )
        kind = "path" if clear else "volpath"
        self._integrator = mi.load_dict({"type": kind, "max_depth": MAX_DEPTH})

    def radiance(self, origin: Any, direction: Any, sampler: Any) -> Any:
        """Radiance arriving at `origin` against `direction`, one sample per lane."""
        ray = mi.RayDifferential3f(mi.Ray3f(origin, direction))
        spectrum, _, _ = self._integrator.sample(self.scene, sampler, ray, self._around)
        return spectrum.x

    def power(self, detectors: DetectorView, *, samples: int, seed: int) -> Floats:
        """Power on each detector, (detectors,), with `samples` paths for each."""
        count = len(detectors.positions_m)
        ends = Detectors.of(detectors, samples)
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(dr.opaque(mi.UInt32, seed), count * samples)
        launch = ends.launch(dr.arange(mi.UInt32, count * samples), sampler)
        power = self.radiance(launch.origin, launch.direction, sampler) * launch.beta
        per_path = np.asarray(power.numpy(), dtype=np.float64).reshape(samples, count)
        return np.asarray(per_path.sum(axis=0) * detectors.area_m2)


def _medium(scene: Scene) -> tuple[Any, dict[str, Any] | None]:
    """The scene's medium and the surface around it, as Mitsuba has them.

    Mitsuba knows one medium at a place: fog everywhere or one volume, with the instrument outside.
    """
    fogs = [scene.atmosphere] if scene.atmosphere.extinction_per_m > 0 else []
    if len(fogs) + len(scene.volumes) > 1:
        raise InputError("the reference engine takes one medium: fog or one volume, not more")
    boundary: dict[str, Any]
    if fogs:
        centre, radius = fog_ball(scene)
        boundary = {"type": "sphere", "center": centre.tolist(), "radius": radius}
        extinction: Any = fogs[0].extinction_per_m
        optics, kind = fogs[0], "homogeneous"
    elif scene.volumes:
        (volume,) = scene.volumes
        optics, extinction = volume.medium, volume.medium.extinction_per_m
        kind = "homogeneous" if volume.density is None else "heterogeneous"
        # Mitsuba's cube spans [-1, 1]³, its grids [0, 1]³.
        cube = volume.to_world @ np.diag([0.5, 0.5, 0.5, 1.0])
        cube[:3, 3] += volume.to_world[:3, :3] @ [0.5, 0.5, 0.5]
        boundary = {"type": "cube", "to_world": mi.ScalarTransform4f(cube.tolist())}
        if volume.density is not None:
            extinction = {
                "type": "gridvolume",
                "grid": mi.VolumeGrid(volume.density[..., None] * np.float32(extinction)),
                "to_world": mi.ScalarTransform4f(volume.to_world.tolist()),
                "wrap_mode": "clamp",
                "raw": True,
            }
    else:
        return None, None
    medium = mi.load_dict(
        {
            "type": kind,
            "sigma_t": extinction,
            "albedo": optics.albedo,
            "phase": phase_plugin(optics.phase),
            "has_spectral_extinction": False,
        }
    )
    return medium, {**boundary, "bsdf": {"type": "null"}, "interior": medium}


@with_backend
def bucket_powers(
    scene: Scene,
    projector: ProjectorView,
    detector: DetectorView,
    patterns: Iterable[NDArray[np.float32]],
    *,
    samples: int,
    seed: int,
) -> Iterator[float]:
    """Render each pattern (H, W) of unit-power pixels alone; yield the power on all detectors."""
    renderer = Renderer(scene, {"projector": pattern_emitter(projector)})
    for number, pattern in enumerate(patterns):
        renderer.parameters["projector.irradiance.data"] = mi.TensorXf(
            _projector_texture(projector, pattern)
        )
        renderer.parameters.update()
        yield float(renderer.power(detector, samples=samples, seed=seed + number).sum())


def pattern_emitter(projector: ProjectorView, power_per_pixel_w: float = 1.0) -> dict[str, Any]:
    """Mitsuba projector with all pixels on."""
    all_on = np.full(projector.shape, power_per_pixel_w, dtype=np.float32)
    return {
        "type": "projector",
        "irradiance": {
            "type": "bitmap",
            "bitmap": mi.Bitmap(_projector_texture(projector, all_on)),
            "filter_type": "nearest",
            "raw": True,
        },
        "fov": float(np.degrees(2 * np.arctan(projector.tan_half_width))),
        "fov_axis": "x",
        "to_world": mi.ScalarTransform4f((projector.pose @ MITSUBA_FROM_OPTICAL).tolist()),
    }


def _projector_texture(
    projector: ProjectorView, power_w: NDArray[np.floating[Any]]
) -> NDArray[np.float32]:
    """Texture for a power per pixel (H, W); Mitsuba's projector emits π times its "irradiance"."""
    return (power_w / (np.pi * projector.pixel_area))[..., None].astype(np.float32)
