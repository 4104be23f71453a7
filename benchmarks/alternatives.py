"""Other renderers' ways to the same light, to compare with: no part of spisim.

Both use reciprocity: a lamp in the detector's place, seen from the projector or the laser, is one
render for all patterns. An aperture that is small against all distances is a point to them.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any

from reconstruction.base.arrays import Floats
from spisim.transport.backend import activate  # before Mitsuba: it chooses LLVM

# isort: split
import drjit as dr
import mitsuba as mi
import numpy as np
from mitsuba_reference import MAX_DEPTH, Renderer

from spisim.scene import Scene
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.tally import Contribution, ImageTally, PhasorTally
from spisim.transport.engine.walk import lanes_and_sampler
from spisim.transport.views import BeamView, DetectorView, ProjectorView

#: Pixels across the table of the detector's angular response.
RESPONSE_PIXELS = 256


class DualVolpath:
    """Mitsuba's `volpath`: a camera at the projector, pixel for pixel, and a lamp at the detector.

    A virtual pixel emits W = 1 / (a_u cos³θ), so its transport is the mean over its area on the
    image plane of the radiance from a lamp of the detector's intensity: what such a pixel sees.
    """

    def __init__(self, scene: Scene, projector: ProjectorView, detector: DetectorView) -> None:
        activate()
        self._renderer = Renderer(scene, {"lamp": lamp(detector)})
        self._projector, self._area_m2 = projector, detector.area_m2

    def image(self, samples: int, seed: int) -> Floats:
        """Transport image (H, W) from `samples` paths per pixel."""
        camera = Projector.of(self._projector, samples)
        lane, sampler = lanes_and_sampler(camera.lanes, seed)
        launch = camera.launch(lane, sampler)
        radiance = self._renderer.radiance(launch.origin, launch.direction, sampler).numpy()
        per_path = np.asarray(radiance, np.float64).reshape(samples, *self._projector.shape)
        return np.asarray(per_path.mean(axis=0) * self._area_m2)


class TransientSpots:
    """mitransient's `transient_prbvolpath`: one render per laser, along its beam, one lamp each.

    It starts every path in clear air, so the instrument may not be in fog.

    Raises
    ------
    ImportError
        Where mitransient is not installed.
    """

    def __init__(
        self, scene: Scene, beams: BeamView, detectors: DetectorView, frequency_hz: float
    ) -> None:
        activate()
        import_module("mitransient")  # registers the integrator, for the variant that is active
        self.integrator = mi.load_dict({"type": "transient_prbvolpath", "max_depth": MAX_DEPTH})
        self.scenes = [
            Renderer(scene, {"lamp": lamp(_only(detectors, i))}).scene
            for i in range(len(beams.origins_m))
        ]
        self.rays = [
            mi.Ray3f(
                dr.opaque(mi.Point3f, origin.tolist()), dr.opaque(mi.Vector3f, heading.tolist())
            )
            for origin, heading in zip(beams.origins_m, beams.directions, strict=True)
        ]
        self.area_m2, self._frequency_hz = detectors.area_m2, frequency_hz

    def readings(self, samples: int, seed: int) -> Floats:
        """Power and phasor at the frequency, (beams, 3): sum, real and imaginary part."""
        return np.array([self._spot(i, samples, seed) for i in range(len(self.rays))])

    def _spot(self, number: int, samples: int, seed: int) -> Floats:
        _, sampler = lanes_and_sampler(samples, len(self.rays) * seed + number)
        power, phasor = ImageTally(1), PhasorTally(1, (self._frequency_hz,))

        def add(radiance: Any, length_m: Any, wavelengths: Any, active: Any) -> None:
            none = mi.UInt32(0)
            light = Contribution(radiance.x / samples, none, length_m, none, active, none)
            power.add(light)
            phasor.add(light)

        self.integrator.sample(
            mode=dr.ADMode.Primal,
            scene=self.scenes[number],
            sampler=sampler,
            ray=mi.Ray3f(self.rays[number]),
            β=mi.Spectrum(1),
            δL=None,
            state_in=None,
            active=mi.Bool(True),
            add_transient=add,
        )
        sums = np.append(power.read(1)["image"], phasor.read(1)["phasors"])
        return np.asarray(sums * self.area_m2)


class TransientGradients:
    """Derivatives of the power of each spot by mitransient's path replay; see `TransientSpots`.

    `parameter` is that of Mitsuba's scene, a number.

    Raises
    ------
    ImportError
        Where mitransient is not installed.
    """

    def __init__(
        self, scene: Scene, beams: BeamView, detectors: DetectorView, parameter: str
    ) -> None:
        self._spots = TransientSpots(scene, beams, detectors, 0.0)
        self._parameters = [mi.traverse(each) for each in self._spots.scenes]
        self._name = parameter
        for each in self._parameters:
            dr.enable_grad(each[parameter])

    def readings(self, samples: int, seed: int) -> Floats:
        """Derivatives (beams,)."""
        return np.array([self._spot(i, samples, seed) for i in range(len(self._parameters))])

    def _spot(self, number: int, samples: int, seed: int) -> float:
        value = self._parameters[number][self._name]
        dr.set_grad(value, 0)
        scale = mi.Spectrum(self._spots.area_m2 / samples)
        none = mi.Spectrum(0)
        state = None
        for mode in (dr.ADMode.Primal, dr.ADMode.Backward):
            _, sampler = lanes_and_sampler(samples, len(self._parameters) * seed + number)
            with dr.suspend_grad():
                *_, state = self._spots.integrator.sample(
                    mode=mode,
                    scene=self._spots.scenes[number],
                    sampler=sampler,
                    ray=mi.Ray3f(self._spots.rays[number]),
                    β=mi.Spectrum(1),
                    δL=none,
                    state_in=state,
                    active=mi.Bool(True),
                    add_transient=lambda *_: None,
                    gather_derivatives_at_distance=lambda *_: scale,
                )
        return float(np.asarray(dr.grad(value).numpy()).sum())


def lamp(detector: DetectorView) -> dict[str, Any]:
    """Mitsuba spot light with the intensity g(θ) cosθ of the detector's angular response."""
    (position,), (axis,) = detector.positions_m, detector.axes
    across = (2 * (np.arange(RESPONSE_PIXELS) + 0.5) / RESPONSE_PIXELS - 1) * np.tan(
        detector.half_angle_rad
    )
    x, y = np.meshgrid(across, across)
    cosine = (1 + x**2 + y**2) ** -0.5
    response = cosine ** (1 + detector.vignetting)
    half_angle_deg = float(np.degrees(detector.half_angle_rad))
    sideways = np.eye(3)[np.argmin(np.abs(axis))]
    return {
        "type": "spot",
        "intensity": {"type": "uniform", "value": 1.0},
        "cutoff_angle": half_angle_deg,  # the same as the beam's width: a hard edge
        "beam_width": half_angle_deg,
        "texture": {
            "type": "bitmap",
            "bitmap": mi.Bitmap(response.astype(np.float32)[..., None]),
            "wrap_mode": "clamp",
            "raw": True,
        },
        "to_world": mi.ScalarTransform4f().look_at(
            origin=position.tolist(), target=(position + axis).tolist(), up=sideways.tolist()
        ),
    }


def _only(detectors: DetectorView, number: int) -> DetectorView:
    """One of several detectors."""
    chosen = slice(number, number + 1)
    return replace(
        detectors, positions_m=detectors.positions_m[chosen], axes=detectors.axes[chosen]
    )
