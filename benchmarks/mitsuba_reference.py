"""Mitsuba's own integrators on the same scene: one render per pattern.

Nothing here shares code with the two-ended estimator: `volpath` finds the light, and Mitsuba's
`projector` emits the patterns. It is the reference of the tests and the baseline of the benchmarks.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import combinations
from types import MappingProxyType
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from mitsuba_reference_scene import medium_dict, reference_scene
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument.views import DetectorView, ProjectorView
from spisim.scene import Scene
from spisim.scene.volumes import share_space
from spisim.transport.backend import with_backend
from spisim.transport.bsdf import is_null_transmitting
from spisim.transport.engine.apertures import Detectors
from spisim.transport.jit import Float, Point, Sampler, Vector
from spisim.transport.world import fog_ball

#: What is cut off is below the noise; roulette ends paths long before.
MAX_DEPTH = 256
#: Mitsuba's cameras and projectors have x to the left and y up; the optical frame has neither.
MITSUBA_FROM_OPTICAL = np.diag([-1.0, -1.0, 1.0, 1.0])


class Renderer:
    """A scene with its lamps and further emitters, rendered by Mitsuba's `volpath`.

    Mitsuba allows one medium at a point: fog everywhere, or volumes that do not overlap, with the
    instrument outside of them.
    """

    def __init__(
        self,
        scene: Scene,
        emitters: Mapping[str, Any] = MappingProxyType({}),
        *,
        watts_per_klm: float = 1.0,
        max_depth: int = MAX_DEPTH,
    ) -> None:
        fogs = [scene.atmosphere] if scene.atmosphere.extinction_per_m > 0 else []
        if len(fogs) > 0 and scene.volumes:
            raise InputError(
                "the scene has fog and volumes: the reference engine takes only one of them"
            )
        for first, second in combinations(scene.volumes, 2):
            if share_space(first, second):
                raise InputError(
                    f"volumes {first.name!r} and {second.name!r} overlap, which the reference "
                    "engine does not support"
                )
        description = {"type": "scene", **reference_scene(scene, watts_per_klm), **emitters}
        self._around = None  # the medium that the instrument is in
        for air in fogs:
            self._around = mi.load_dict(medium_dict(air, air.extinction_per_m))
            centre, radius = fog_ball(scene)
            ball = {"type": "sphere", "center": centre.tolist(), "radius": radius}
            description["fog"] = {**ball, "bsdf": {"type": "null"}, "interior": self._around}
            for name, emitter in emitters.items():
                description[name] = {**emitter, "medium": self._around}
        self.scene = mi.load_dict(description)
        self.parameters = mi.traverse(self.scene)
        # Only volpath connects a path to the emitter through panes and masks.
        clear = (
            not fogs
            and not scene.volumes
            and not any(is_null_transmitting(thing.material) for thing in scene.objects)
        )
        kind = "path" if clear else "volpath"
        self._integrator = mi.load_dict({"type": kind, "max_depth": max_depth})

    def radiance(self, origin: Point, direction: Vector, sampler: Sampler) -> Float:
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
