"""Mitsuba's own integrators on the same scene: one render per pattern.

Nothing here shares the two-ended estimator: `volpath` finds the light, Mitsuba's `projector`
emits the patterns. That makes it the oracle of the tests and the baseline of the benchmarks.
Daylight and pictures, which need no transport image, are rendered the same way.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.ends import Detectors
from spisim.transport.views import DetectorView, Floats, ProjectorView
from spisim.transport.world import fog_ball, medium, shapes

#: Deep enough that what is cut off cannot be measured; roulette ends paths long before.
MAX_DEPTH = 256
#: Mitsuba's cameras and projectors have x to the left and y up; the optical frame has neither.
MITSUBA_FROM_OPTICAL = np.diag([-1.0, -1.0, 1.0, 1.0])


class Renderer:
    """A scene with emitters, lit and seen through its fog by Mitsuba's `volpath`."""

    def __init__(self, scene: Scene, emitters: dict[str, Any]) -> None:
        description: dict[str, Any] = {"type": "scene", **shapes(scene.objects), **emitters}
        self._medium = None
        if scene.atmosphere.extinction_per_m > 0:
            centre, radius = fog_ball(scene)
            self._medium = mi.load_dict(medium(scene.atmosphere))
            description["fog"] = {
                "type": "sphere",
                "center": centre.tolist(),
                "radius": radius,
                "bsdf": {"type": "null"},
                "interior": self._medium,
            }
            for name, emitter in emitters.items():
                if emitter["type"] == "projector":
                    description[name] = {**emitter, "medium": self._medium}
        self.scene = mi.load_dict(description)
        self.parameters = mi.traverse(self.scene)
        kind = "path" if self._medium is None else "volpath"
        self._integrator = mi.load_dict({"type": kind, "max_depth": MAX_DEPTH})

    def radiance(self, origin: Any, direction: Any, sampler: Any) -> Any:
        """Radiance arriving at `origin` against `direction`, one sample per lane."""
        ray = mi.RayDifferential3f(mi.Ray3f(origin, direction))
        spectrum, _, _ = self._integrator.sample(self.scene, sampler, ray, self._medium)
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
    """Render each pattern (H, W) of unit-power pixels on its own; yield the detector's power."""
    renderer = Renderer(scene, {"projector": pattern_emitter(projector)})
    for number, pattern in enumerate(patterns):
        renderer.parameters["projector.irradiance.data"] = mi.TensorXf(
            _projector_texture(projector, pattern)
        )
        renderer.parameters.update()
        yield float(renderer.power(detector, samples=samples, seed=seed + number)[0])


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
