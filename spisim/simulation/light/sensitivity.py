"""How light changes with materials and media, and light in fog of another extinction, in one pass.

Paths have weights by what they have met (see `spisim.transport.engine.path_weights`); sums of
weighted light are recorded beside the light.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.scene import Scene
from spisim.simulation.light.parameters import Derivative, parameters_of
from spisim.simulation.light.solve import Transport
from spisim.transport.engine.path_weights import ExtinctionRatio, PathWeight

#: Least fraction of the light's paths that may carry an estimate at another extinction.
MIN_CARRIED = 0.3


def sensitivities(scene: Scene, parameters: Sequence[str]) -> list[Derivative]:
    """Derivatives of light by parameters of a scene.

    Parameters
    ----------
    scene
        What the light is traced through.
    parameters
        Names among those of `parameters_of` the scene.

    Returns
    -------
    list of Sensitivity or Proportional
        Their weights go into `Outputs.weights`.

    Raises
    ------
    InputError
        For an unknown name, and where paths do not say the derivative: clear air, weather that is a
        mixture, fog whose visibility is unknown or that does not scatter, a phase function other
        than Henyey and Greenstein's, materials that reflect nothing or by refraction alone.
    """
    known = parameters_of(scene)
    for name in parameters:
        if name not in known:
            raise InputError(f"sensitivity {name!r}: {nearest(name, known)}")
    return [known[name]() for name in parameters]


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


def weights_of(wanted: Sequence[Derivative | OtherFog]) -> tuple[PathWeight, ...]:
    """Weights to record, each once."""
    each: dict[str, PathWeight] = {}
    for one in wanted:
        each |= {weight.name: weight for weight in one.weights}
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
