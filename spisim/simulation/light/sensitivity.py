"""How light changes with the fog, from one pass.

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
from spisim.simulation.light.other_fog import require_fog_alone
from spisim.simulation.light.solve import Transport
from spisim.transport.engine.path_weights import PathWeight, Score


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
        require_fog_alone(scene)
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


def weights_of(wanted: Sequence[Sensitivity]) -> tuple[PathWeight, ...]:
    """Weights to record, each once."""
    return tuple({one.weight.name: one.weight for one in wanted}.values())
