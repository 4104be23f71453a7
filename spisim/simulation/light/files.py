"""Light and truth as files: OpenEXR images and NumPy histograms."""

import io
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.files import mark, write_atomically
from spisim.base.exr import write_exr
from spisim.simulation.light.parameters import Derivative
from spisim.simulation.light.solve import Transport
from spisim.transport.engine.tally import ORDERS
from spisim.transport.truth import GroundTruth

#: Units of channels and arrays that are not plain numbers.
UNITS = {"range_m": "m", "depth_m": "m", "path_length_m": "m", "cube_path_length_m": "m"}
#: Arrays of `Transport.extra` that are written with the histograms.
OVER_PATH_LENGTH = ("spot_orders", "cube", "cube_orders", "cube_path_length_m")


def write_truth(
    path: Path,
    truth: GroundTruth,
    extra: Mapping[str, NDArray[np.floating]],
    extra_units: Mapping[str, str] | None = None,
) -> None:
    """Write the ground truth, and further (H, W) channels with their units, as OpenEXR.

    The header states the unit of every channel and the names behind `object_id`.
    """
    channels: dict[str, NDArray[np.floating]] = {
        "range_m": truth.range_m,
        "depth_m": truth.depth_m,
        "reflectance": truth.reflectance,
        "object_id": np.asarray(truth.object_id, np.float32),
        "coverage": truth.coverage,
        **{f"normal.{axis}": truth.normal[..., k] for k, axis in enumerate("XYZ")},
        **extra,
    }
    every = UNITS | dict(extra_units or {})
    units = {f"units.{name}": every.get(name, "1") for name in channels}
    names = {f"object.{k}": name for k, name in enumerate(truth.object_names)}
    write_exr(path, "transport image", channels, units | names)


def light_channels(
    light: Transport, frequencies_hz: Sequence[float]
) -> dict[str, NDArray[np.floating]]:
    """The light of the pixels as (H, W) channels."""
    channels: dict[str, NDArray[np.floating]] = {
        "transport": light.image,
        "transport_error": light.image_error,
    }
    if "orders" in light.extra:
        channels |= _by_order("transport", light.extra["orders"])
    for number, frequency in enumerate(frequencies_hz):
        name = f"phasor_{frequency / 1e6:g}MHz"
        phasors = {name: light.extra["phasors"][number]}
        if "phasor_orders" in light.extra:
            phasors |= _by_order(name, light.extra["phasor_orders"][:, number])
        for layer, phasor in phasors.items():
            channels |= {f"{layer}.real": phasor.real, f"{layer}.imag": phasor.imag}
    return channels


def derived_channels(
    light: Transport,
    derivatives: Sequence[Derivative],
    others: Mapping[float, Transport],
) -> dict[str, NDArray[np.floating]]:
    """Derivatives of the image, and the image at other visibilities, as (H, W) channels."""
    channels: dict[str, NDArray[np.floating]] = {}
    for each in derivatives:
        name = f"transport_per.{each.parameter}"
        channels[name], channels[f"{name}_error"] = each.of(light)
    for visibility_m, other in others.items():
        name = f"transport_at_{visibility_m:g}m"
        channels[name], channels[f"{name}_error"] = other.image, other.image_error
    return channels


def _by_order(name: str, parts: NDArray[Any]) -> dict[str, NDArray[Any]]:
    return {f"{name}.{order}": part for order, part in zip(ORDERS, parts, strict=True)}


#: Fields of `Transport` whose derivatives are written with the histograms, and their units.
DERIVED = {
    "spot_histogram": "1",
    "daylight_w": "W",
    "spot_daylight_w": "W",
    "spot_crosstalk_w": "W",
}


def _times(unit: str, per: str) -> str:
    """A unit times the unit of one over a parameter."""
    if "1" in (unit, per):
        return unit if per == "1" else per
    return unit + per[1:] if per.startswith("1/") else f"{unit} {per}"


def write_histograms(
    path: Path,
    light: Transport,
    derivatives: Sequence[Derivative] = (),
    others: Mapping[float, Transport] = MappingProxyType({}),
) -> None:
    """Write light over path length, of the spots and the cube, as a NumPy file.

    With it go the derivatives of all light but the image's, as ``<field>_per.<parameter>``, their
    standard errors, and the spots' light in fog of other visibilities. `units.<name>` is the unit
    of each array.
    """
    arrays = {
        "spot_histogram": light.spot_histogram,
        "path_length_m": light.path_length_m,
        **{name: light.extra[name] for name in OVER_PATH_LENGTH if name in light.extra},
        **{
            f"spot_histogram_at_{visibility_m:g}m": other.spot_histogram
            for visibility_m, other in others.items()
        },
    }
    units = {f"units.{name}": np.array(UNITS.get(name, "1")) for name in arrays}
    for each in derivatives:
        for field, unit in DERIVED.items():
            name = f"{field}_per.{each.parameter}"
            arrays[name], arrays[f"{name}_error"] = each.of(light, field)
            whole = np.array(_times(unit, each.unit))
            units |= {f"units.{name}": whole, f"units.{name}_error": whole}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **arrays, **units)
    with zipfile.ZipFile(buffer, "a") as archive:
        archive.comment = mark("histograms").encode()
    write_atomically(path, buffer.getvalue())
