"""How light changes with materials and media, from one pass.

Paths have weights by what they have met (see `spisim.transport.engine.path_weights`); sums of
weighted light are recorded beside the light.
"""

from collections.abc import Sequence

from reconstruction.base.errors import InputError, nearest
from spisim.scene import Scene
from spisim.simulation.light.parameters import Derivative, parameters_of
from spisim.transport.engine.path_weights import PathWeight


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


def weights_of(wanted: Sequence[Derivative]) -> tuple[PathWeight, ...]:
    """Weights to record, each once."""
    return tuple({weight.name: weight for one in wanted for weight in one.weights}.values())
