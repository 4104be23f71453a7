"""What the commands write besides captures, results and pages."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spisim.transport import GroundTruth, Transport

UNITS = {"range_m": "m", "depth_m": "m"}  # of channels that are not plain numbers


def write_truth(path: Path, truth: GroundTruth, extra: Mapping[str, NDArray[np.floating]]) -> None:
    """Write what is truly there, and further (H, W) channels, as OpenEXR.

    The header tells the unit of every channel and the names behind `object_id`.
    """
    from spisim.exr import write_exr

    channels: dict[str, NDArray[np.floating]] = {
        "range_m": truth.range_m,
        "depth_m": truth.depth_m,
        "reflectance": truth.reflectance,
        "object_id": np.asarray(truth.object_id, np.float32),
        "coverage": truth.coverage,
        **{f"normal.{axis}": truth.normal[..., k] for k, axis in enumerate("XYZ")},
        **extra,
    }
    units = {f"units.{name}": UNITS.get(name, "1") for name in channels}
    names = {f"object.{k}": name for k, name in enumerate(truth.object_names)}
    write_exr(path, channels, units | names)


def light_channels(
    light: Transport, frequencies_hz: Sequence[float]
) -> dict[str, NDArray[np.floating]]:
    """The light of the pixels as (H, W) channels."""
    channels: dict[str, NDArray[np.floating]] = {
        "transport": light.image,
        "transport_error": light.image_error,
    }
    if "orders" in light.extra:
        names = ("transport.unscattered", "transport.single", "transport.multiple")
        channels |= dict(zip(names, light.extra["orders"], strict=True))
    for frequency, phasor in zip(frequencies_hz, light.extra.get("phasors", ()), strict=False):
        name = f"phasor_{frequency / 1e6:g}MHz"
        channels |= {f"{name}.real": phasor.real, f"{name}.imag": phasor.imag}
    return channels


def write_histogram(path: Path, light: Transport) -> None:
    """Write the light of the four spots over path length as a NumPy file."""
    from reconstruction.files import write_atomically

    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, spot_histogram=light.spot_histogram, path_length_m=light.path_length_m
    )
    write_atomically(path, buffer.getvalue())
