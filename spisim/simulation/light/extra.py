"""All recorded light besides image and histograms, with pixels as rows and columns."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.transport.daylight import Received
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.path_weights import PathWeight
from spisim.transport.engine.sampling import Estimate


def extra_light(
    outputs: Outputs,
    image: Mapping[str, Floats] | None,
    spots: Mapping[str, Floats],
    shape: tuple[int, int],
) -> dict[str, NDArray[Any]]:
    """All recorded light besides the image, with pixels as rows and columns."""
    extra: dict[str, NDArray[Any]] = {}
    if outputs.orders:
        extra["spot_orders"] = spots["histogram_orders"]
    if image is None:
        return extra
    if outputs.orders:
        extra["orders"] = image["image_orders"].reshape(-1, *shape)
    if outputs.frequencies_hz:
        extra["phasors"] = _phasors(image["phasors"], shape)
        if outputs.orders:
            extra["phasor_orders"] = _phasors(image["phasors_orders"], shape)
    if outputs.bins is not None:
        extra["cube"] = image["histogram"].reshape(*shape, -1)
        extra["cube_path_length_m"] = outputs.bins.centres_m
        if outputs.orders:
            extra["cube_orders"] = image["histogram_orders"].reshape(-1, *shape, outputs.bins.count)
    return extra


def weighted_light(
    outputs: Outputs, image: Estimate | None, spots: Estimate, shape: tuple[int, int]
) -> dict[str, NDArray[Any]]:
    """Sums of weighted light of pixels and spots, and their standard errors.

    Those of phasors are complex, of the real and the imaginary part.
    """
    extra: dict[str, NDArray[Any]] = {}
    kinds: list[tuple[Estimate | None, str, str, Callable[[Floats], NDArray[Any]]]] = [
        (image, "image", "image", lambda values: values.reshape(shape)),
        (image, "phasors", "phasors", lambda values: _phasors(values, shape)),
        (image, "histogram", "cube", lambda values: values.reshape(*shape, -1)),
        (spots, "histogram", "spot_histogram", lambda values: values),
    ]
    for weight in outputs.weights:
        for estimate, sums, name, shaped in kinds:
            if estimate is not None and f"{sums}_{weight.name}" in estimate.mean:
                for part, ending in ((estimate.mean, ""), (estimate.error, "_error")):
                    values = part[f"{sums}_{weight.name}"]
                    extra[f"{name}_{weight.name}{ending}"] = shaped(values)
    return extra


def steady_weighted(
    weights: Sequence[PathWeight], bucket: Received, spots: Received, crosstalk: Received
) -> dict[str, NDArray[Any]]:
    """Weighted steady light, by the names of its fields of `Transport`, and its standard errors."""
    extra: dict[str, NDArray[Any]] = {}
    for weight in weights:
        for name, light in (("spot_daylight_w", spots), ("spot_crosstalk_w", crosstalk)):
            power, error = light.weighted[weight.name]
            extra |= {f"{name}_{weight.name}": power, f"{name}_{weight.name}_error": error}
        power, error = bucket.weighted[weight.name]
        extra[f"daylight_w_{weight.name}"] = np.asarray(power.sum())
        extra[f"daylight_w_{weight.name}_error"] = np.asarray(np.linalg.norm(error))
    return extra


def _phasors(parts: Floats, shape: tuple[int, int]) -> NDArray[np.complex128]:
    """Complex images (..., F, H, W) from real and imaginary parts (..., H·W, F, 2)."""
    values = np.moveaxis(parts[..., 0] + 1j * parts[..., 1], -1, -2)
    return values.reshape(*values.shape[:-1], *shape)
