"""How light changes with the fog, and light in fog of another extinction, from one pass.

Fog that fills the whole scene gives each path a weight by what it met (see
`spisim.transport.engine.path_weights`); sums of weighted light are recorded beside the light.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.scene import Scene
from spisim.simulation.light.solve import Transport
from spisim.transport.engine.path_weights import ExtinctionRatio, PathWeight, Score

#: Least fraction of the light's paths that may carry an estimate at another extinction.
MIN_CARRIED = 0.3


@dataclass(frozen=True)
class Sensitivity:
    """Derivative by a parameter: ``scale`` times the sums weighted by ``weight``.

    The derivative of an array ``x`` of `Transport` is that of `by` of its name.
    """

    parameter: str
    unit: str
    weight: Score
    scale: float

    def of(self, light: Transport, name: str = "image") -> tuple[NDArray[np.float64], Floats]:
        """Derivative and standard error of "image" (H, W) or "spot_histogram" (spots, bins)."""
        weighted = light.extra[f"{name}_{self.weight.name}"]
        error = light.extra[f"{name}_{self.weight.name}_error"]
        return self.scale * weighted, abs(self.scale) * error


def sensitivities(scene: Scene, parameters: Sequence[str]) -> list[Sensitivity]:
    """Derivatives of light by parameters of a scene's fog.

    Parameters
    ----------
    scene
        With fog, alone and everywhere.
    parameters
        Names of `PARAMETERS`.

    Returns
    -------
    list of Sensitivity
        Their weights go into `Outputs.weights`.

    Raises
    ------
    InputError
        For an unknown name, and if paths of the scene do not tell the derivative: clear air, other
        media, or fog whose visibility is unknown.
    """
    for name in parameters:
        if name not in PARAMETERS:
            raise InputError(f"sensitivity {name!r}: {nearest(name, PARAMETERS)}")
    if parameters:
        _require_fog_alone(scene)
    return [PARAMETERS[name](scene) for name in parameters]


def _by_extinction(scene: Scene) -> Sensitivity:
    name, sigma = "scene.fog.extinction_per_m", scene.atmosphere.extinction_per_m
    return Sensitivity(name, "m", Score("by_extinction", 1.0, sigma), 1 / sigma)


def _by_albedo(scene: Scene) -> Sensitivity:
    if not (albedo := scene.atmosphere.albedo) > 0:
        raise InputError("scene.fog.albedo = 0: its derivative needs light that fog scatters")
    return Sensitivity("scene.fog.albedo", "1", Score("by_albedo", 1.0, 0.0), 1 / albedo)


def _by_visibility(scene: Scene) -> Sensitivity:
    """The extinction of given droplets is inversely proportional to the visibility."""
    if (visibility_m := scene.atmosphere.visibility_m) is None:
        raise InputError("scene.fog.visibility_m: the visibility of this fog is unknown")
    weight = Score("by_extinction", 1.0, scene.atmosphere.extinction_per_m)
    return Sensitivity("scene.fog.visibility_m", "1/m", weight, -1 / visibility_m)


PARAMETERS: dict[str, Callable[[Scene], Sensitivity]] = {
    "scene.fog.visibility_m": _by_visibility,
    "scene.fog.extinction_per_m": _by_extinction,
    "scene.fog.albedo": _by_albedo,
}


@dataclass(frozen=True)
class OtherFog:
    """The same fog of ``ratio`` times the extinction, from the paths of the scene's own."""

    ratio: float
    weights: tuple[ExtinctionRatio, ExtinctionRatio]

    @classmethod
    def of(cls, scene: Scene, ratio: float) -> "OtherFog":
        """Fog of a scene, thicker or thinner.

        Raises InputError as `sensitivities`, and unless the ratio is positive and finite.
        """
        _require_fog_alone(scene)
        if not 0 < ratio < np.inf:
            raise InputError(f"ratio = {ratio:g}: must be positive and finite")
        sigma = scene.atmosphere.extinction_per_m
        name = f"in_{ratio:.6g}_times_the_fog"
        square = ExtinctionRatio(f"{name}_squared", ratio, sigma, power=2)
        return cls(ratio, (ExtinctionRatio(name, ratio, sigma), square))

    @classmethod
    def of_visibility(cls, scene: Scene, visibility_m: float) -> "OtherFog":
        """The same droplets, more or fewer; InputError as `of`, and if visibility is unknown."""
        _require_fog_alone(scene)
        if (own_m := scene.atmosphere.visibility_m) is None:
            raise InputError(f"visibility_m = {visibility_m:g}: that of the scene's fog is unknown")
        return cls.of(scene, own_m / visibility_m)

    def carried(self, light: Transport) -> float:
        """Fraction of the light's paths that carry the estimate: (Σ v w)² / (Σ v Σ v w²)."""
        sums = (light.extra[f"image_{weight.name}"].sum() for weight in self.weights)
        first, second = sums
        return float(first**2 / (light.image.sum() * second))

    def image(self, light: Transport) -> tuple[Floats, Floats]:
        """Transport image (H, W) in the other fog, and its standard error.

        Raises InputError if fewer than `MIN_CARRIED` of the paths carry it.
        """
        carried = self.carried(light)
        if not carried >= MIN_CARRIED:
            raise InputError(
                f"fog of {self.ratio:g} times the extinction is too far from what was traced: "
                f"{carried:.0%} of the paths carry the estimate, at least {MIN_CARRIED:.0%} are "
                "needed; trace a scene with fog nearer to it"
            )
        name = f"image_{self.weights[0].name}"
        return light.extra[name], light.extra[f"{name}_error"]


def weights_of(wanted: Sequence[Sensitivity | OtherFog]) -> tuple[PathWeight, ...]:
    """Weights to record, each once."""
    each: dict[str, PathWeight] = {}
    for one in wanted:
        some = one.weights if isinstance(one, OtherFog) else (one.weight,)
        each |= {weight.name: weight for weight in some}
    return tuple(each.values())


def _require_fog_alone(scene: Scene) -> None:
    fog = scene.atmosphere
    if not fog.extinction_per_m > 0:
        raise InputError("the air is clear: without fog nothing depends on it")
    if fog.parts or scene.volumes or scene.precipitation:
        raise InputError(
            "paths tell how they depend on fog that is alone and everywhere: remove other weather "
            "and volumes"
        )
