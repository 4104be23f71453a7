"""Parameters of a scene by which paths say the derivative of light."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere import Atmosphere, HenyeyGreenstein
from spisim.scene import Scene
from spisim.scene.bsdf import Clear, Principled
from spisim.simulation.light.displacement import Displacement
from spisim.simulation.light.solve import Transport
from spisim.transport.engine.path_weights import Score
from spisim.transport.scores import Albedo, Asymmetry, Extinction, Parameter, Reflectance


@dataclass(frozen=True)
class Sensitivity:
    """Derivative by a parameter: ``scale`` times the sums weighted by ``weight``."""

    parameter: str
    unit: str  # of one over the parameter
    weight: Score
    scale: float

    @classmethod
    def by(cls, parameter: str, unit: str, score: Parameter, scale: float) -> "Sensitivity":
        """A derivative whose score no other parameter shares."""
        return cls(parameter, unit, Score(f"by_{parameter}", score), scale)

    @property
    def weights(self) -> tuple[Score, ...]:
        """What a pass has to record."""
        return (self.weight,)

    def of(self, light: Transport, name: str = "image") -> tuple[NDArray[np.float64], Floats]:
        """Derivative and standard error of a field of `Transport`.

        Of "image" (H, W), "spot_histogram" (spots, bins), "daylight_w", "spot_daylight_w" (spots,),
        "spot_crosstalk_w" (spots,), and, of what `Outputs` asked for, "phasors" (F, H, W), whose
        errors are complex, too, and "cube" (H, W, bins).
        """
        weighted = light.extra[f"{name}_{self.weight.name}"]
        error = light.extra[f"{name}_{self.weight.name}_error"]
        return self.scale * weighted, abs(self.scale) * error


@dataclass(frozen=True)
class Proportional:
    """Derivative by a factor, 1, on some of the light: that light itself, nothing of the rest."""

    parameter: str
    fields: tuple[str, ...]  # of `Transport`
    unit: str = "1"

    @property
    def weights(self) -> tuple[Score, ...]:
        """What a pass has to record: nothing."""
        return ()

    def of(self, light: Transport, name: str = "image") -> tuple[NDArray[np.float64], Floats]:
        """See `Sensitivity`."""
        error = name.removesuffix("_w") + ("_error_w" if name.endswith("_w") else "_error")
        factor = 1.0 if name in self.fields else 0.0
        return factor * np.asarray(getattr(light, name)), factor * np.asarray(getattr(light, error))


#: Factors on powers, and on all that the detectors receive.
PROPORTIONAL: Mapping[str, tuple[str, ...]] = {
    "projector.power": ("image", "spot_crosstalk_w"),
    "lasers.power": ("spot_histogram",),
    "daylight": ("daylight_w", "spot_daylight_w"),
    "gain": ("image", "spot_histogram", "daylight_w", "spot_daylight_w", "spot_crosstalk_w"),
}

Derivative = Sensitivity | Proportional | Displacement
#: Makes the derivative by a parameter, or raises InputError if paths do not say it.
Make = Callable[[], Derivative]


def parameters_of(scene: Scene) -> dict[str, Make]:
    """Parameters of a scene by name.

    ``materials.NAME`` is a factor, 1, on the reflectance of a material, textures included, wherever
    the scene has it. ``scene.fog`` is the weather, ``scene.volumes.NAME`` a volume. Those of
    `PROPORTIONAL` are factors, 1, on light in watts and on what detectors make of it.
    """
    known: dict[str, Make] = {
        f"scene.fog.{name}": partial(make, scene) for name, make in FOG.items()
    }
    first = 1 if scene.atmosphere.extinction_per_m > 0 else 0
    for number, volume in enumerate(scene.volumes, first):
        for name, of_medium in MEDIUM.items():
            parameter = f"scene.volumes.{volume.name}.{name}"
            known[parameter] = partial(of_medium, parameter, volume.medium, number)
    for material in sorted({thing.material.name for thing in scene.objects}):
        known[f"materials.{material}"] = partial(_by_reflectance, scene, material)
    for name, lit in PROPORTIONAL.items():
        known[name] = partial(Proportional, name, lit)
    return known


def _by_reflectance(scene: Scene, name: str) -> Sensitivity:
    parameter = f"materials.{name}"
    for material in (thing.material for thing in scene.objects if thing.material.name == name):
        bsdf = material.bsdf
        if isinstance(bsdf, Clear):
            raise InputError(f"{parameter}: glass reflects by refraction alone")
        if isinstance(bsdf, Principled) and 0 < bsdf.metallic < 1:
            raise InputError(
                f"{parameter}: metallic = {bsdf.metallic:g} mixes two surfaces; it must be 0 or 1"
            )
        if not material.reflectance > 0:
            raise InputError(f"{parameter}: reflectance = 0, so that no path meets it and goes on")
    return Sensitivity.by(parameter, "1", Reflectance(name), 1.0)


def _by_extinction(parameter: str, medium: Atmosphere, number: int) -> Sensitivity:
    sigma = medium.extinction_per_m
    if not sigma > 0:
        raise InputError(f"{parameter}: the air is clear, without fog nothing depends on it")
    return Sensitivity.by(parameter, "m", Extinction(number), 1 / sigma)


def _by_albedo(parameter: str, medium: Atmosphere, number: int) -> Sensitivity:
    if not medium.albedo > 0:
        raise InputError(f"{parameter} = 0: its derivative needs light that fog scatters")
    return Sensitivity.by(parameter, "1", Albedo(number), 1 / medium.albedo)


def _by_asymmetry(parameter: str, medium: Atmosphere, number: int) -> Sensitivity:
    if not isinstance(medium.phase, HenyeyGreenstein):
        raise InputError(f"{parameter}: the phase function must be that of Henyey and Greenstein")
    return Sensitivity.by(parameter, "1", Asymmetry(number, medium.phase.g), 1.0)


#: Parameters of a medium, from its full name, itself and its index.
MEDIUM: Mapping[str, Callable[[str, Atmosphere, int], Sensitivity]] = {
    "extinction_per_m": _by_extinction,
    "albedo": _by_albedo,
    "g": _by_asymmetry,
}


def _of_fog(name: str, scene: Scene) -> Sensitivity:
    """Of the weather, unless it is a mixture: paths do not say which part has scattered them."""
    fog = scene.atmosphere
    if fog.parts:
        names = " and ".join(part.kind for part in fog.parts)
        raise InputError(f"scene.fog.{name}: the weather is a mixture of {names}; leave one alone")
    if not fog.extinction_per_m > 0:
        raise InputError(f"scene.fog.{name}: the air is clear, without fog nothing depends on it")
    return MEDIUM[name](f"scene.fog.{name}", fog, 0)


def _by_visibility(scene: Scene) -> Sensitivity:
    """The extinction of given droplets is inversely proportional to the visibility."""
    weight = _of_fog("extinction_per_m", scene).weight
    if (visibility_m := scene.atmosphere.visibility_m) is None:
        raise InputError("scene.fog.visibility_m: the visibility of this fog is unknown")
    return Sensitivity("scene.fog.visibility_m", "1/m", weight, -1 / visibility_m)


#: Parameters of the weather.
FOG: Mapping[str, Callable[[Scene], Sensitivity]] = {
    "visibility_m": _by_visibility,
    **{name: partial(_of_fog, name) for name in MEDIUM},
}
