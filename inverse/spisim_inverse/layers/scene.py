"""The transport image by parameters of its scene, to first order, from derivatives of one pass."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from reconstruction.base.errors import InputError
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light import Transport, solve
from spisim.simulation.light.parameters import Derivative
from spisim.simulation.light.sensitivity import sensitivities, weights_of
from spisim.transport import Outputs

Array = Any
"""An array of NumPy, PyTorch or JAX."""
Derivative = Derivative


@dataclass(frozen=True, eq=False)
class SceneImage:
    """Transport image x + sum_j c_j dx/dv_j where parameters v of the scene change by c.

    Parameters
    ----------
    names
        Parameters (P,) of the scene.
    image
        Transport image (H, W) as it was traced.
    derivatives
        Of the image by the parameters, (P, H, W).
    """

    names: tuple[str, ...]
    image: Array
    derivatives: Array

    @classmethod
    def traced(
        cls,
        scene: Scene,
        instrument: Instrument,
        parameters: Sequence[str],
        *,
        spp: int = 256,
        seed: int = 0,
    ) -> Self:
        """Trace the light of a scene with its derivatives.

        Raises InputError as `sensitivities` does, naming a parameter whose derivative the paths do
        not have.
        """
        wanted = sensitivities(scene, parameters)
        _require_some(wanted)
        outputs = Outputs(weights=weights_of(wanted))
        return cls.of(solve(scene, instrument, spp=spp, seed=seed, outputs=outputs), wanted)

    @classmethod
    def of(cls, light: Transport, wanted: Sequence[Derivative]) -> Self:
        """From light that was traced with the weights of `wanted`; InputError if it was not."""
        _require_some(wanted)
        for each in wanted:
            if any(f"image_{weight.name}" not in light.extra for weight in each.weights):
                raise InputError(
                    f"{each.parameter}: the light was traced without its derivative; pass its "
                    "weights to Outputs"
                )
        derivatives = np.array([each.of(light)[0] for each in wanted])
        return cls(tuple(each.parameter for each in wanted), light.image, derivatives)


def _require_some(wanted: Sequence[Derivative]) -> None:
    if not wanted:
        raise InputError("no parameter of the scene is named; at least one is needed")


def image_of(scene: SceneImage, changes: Array) -> Array:
    """Transport image (..., H, W) for changes (..., P) of the parameters, in their units."""
    change = changes @ _rows(scene)
    return scene.image + change.reshape(*changes.shape[:-1], *scene.image.shape)


def image_vjp(scene: SceneImage, changes: Array, gradient: Array) -> tuple[Array]:
    """Gradient by the changes (..., P), given that by the image (..., H, W)."""
    flat = gradient.reshape(*changes.shape[:-1], scene.image.shape[0] * scene.image.shape[1])
    return (flat @ _rows(scene).T,)


def _rows(scene: SceneImage) -> Array:
    return scene.derivatives.reshape(len(scene.names), -1)
