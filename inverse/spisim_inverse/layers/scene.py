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


@dataclass(frozen=True, eq=False)
class SceneImage:
    """x(v) = x + sum_j (v_j - v0_j) dx/dv_j.

    Parameters
    ----------
    names
        Parameters (P,) of the scene.
    start
        Values (P,) that the light was traced at.
    image
        Transport image (H, W) there.
    derivatives
        Of the image by the parameters, (P, H, W).
    """

    names: tuple[str, ...]
    start: Array
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
        if not wanted:
            raise InputError("parameters: no name; at least one is needed")
        start = [_value(scene, each) for each in wanted]
        outputs = Outputs(weights=weights_of(wanted))
        return cls.of(solve(scene, instrument, spp=spp, seed=seed, outputs=outputs), wanted, start)

    @classmethod
    def of(cls, light: Transport, wanted: Sequence[Derivative], start: Sequence[float]) -> Self:
        """From light that was traced with the weights of `wanted`, at these values."""
        for each in wanted:
            if any(f"image_{weight.name}" not in light.extra for weight in each.weights):
                raise InputError(
                    f"{each.parameter}: the light was traced without its derivative; pass its "
                    "weight to Outputs"
                )
        derivatives = np.array([each.of(light)[0] for each in wanted])
        names = tuple(each.parameter for each in wanted)
        return cls(names, np.asarray(start, np.float64), light.image, derivatives)


def image_of(scene: SceneImage, values: Array) -> Array:
    """Transport image (..., H, W) at values (..., P) of the parameters."""
    change = (values - scene.start) @ _rows(scene)
    return scene.image + change.reshape(*values.shape[:-1], *scene.image.shape)


def image_vjp(scene: SceneImage, values: Array, gradient: Array) -> tuple[Array]:
    """Gradient by the values (..., P), given that by the image (..., H, W)."""
    flat = gradient.reshape(*values.shape[:-1], scene.image.shape[0] * scene.image.shape[1])
    return (flat @ _rows(scene).T,)


def _rows(scene: SceneImage) -> Array:
    return scene.derivatives.reshape(len(scene.names), -1)


def _value(scene: Scene, each: Derivative) -> float:
    """Of a parameter of the fog."""
    section, _, name = each.parameter.rpartition(".")
    if section != "scene.fog":
        raise InputError(f"{each.parameter}: state the value it was traced at, with SceneImage.of")
    return float(getattr(scene.atmosphere, name))
