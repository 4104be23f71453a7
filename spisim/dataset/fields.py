"""Arrays that a capture holds, under the names by which data sets hand them out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture
from reconstruction.default_ranging import default_ranges


@dataclass(frozen=True)
class Field:
    """An array of every capture; `read` gives None where a capture lacks it."""

    dims: tuple[str, ...]
    units: str
    meaning: str
    read: Callable[[Capture], NDArray[Any] | None]


def _spots(name: str) -> Callable[[Capture], NDArray[Any] | None]:
    return lambda capture: None if capture.spots is None else getattr(capture.spots, name)


def _truth(name: str) -> Callable[[Capture], NDArray[Any] | None]:
    def read(capture: Capture) -> NDArray[Any] | None:
        truth = capture.truth
        if truth is None:
            return None
        return np.stack([getattr(truth.at(frame), name) for frame in range(capture.frames)])

    return read


def _ranges(name: str) -> Callable[[Capture], NDArray[Any] | None]:
    def read(capture: Capture) -> NDArray[Any] | None:
        if capture.spots is None:
            return None
        frames = [default_ranges(capture, frame) for frame in range(capture.frames)]
        unknown = np.full(4, np.nan)
        return np.stack([unknown if each is None else getattr(each, name) for each in frames])

    return read


_EXPOSURES = ("frame", "exposure")
_SPOTS = ("frame", "spot")
_PIXELS = ("frame", "row", "column")

FIELDS = {
    "buckets": Field(
        _EXPOSURES,
        "electron",
        "light of each exposure; counts where their scale is unknown",
        lambda capture: capture.buckets.signal,
    ),
    "saturated": Field(
        _EXPOSURES,
        "1",
        "exposures that must not be used",
        lambda capture: ~capture.buckets.usable,
    ),
    "spot_readings": Field(
        (*_SPOTS, "tap"),
        "count",
        "taps of the spots, or bins of their histograms",
        _spots("readings"),
    ),
    "spot_range_m": Field(
        _SPOTS, "m", "measured ranges of the spots; nan where there is none", _ranges("range_m")
    ),
    "spot_sigma_m": Field(_SPOTS, "m", "their standard deviation", _ranges("sigma_m")),
    "true_image": Field(_PIXELS, "electron", "electrons of each pixel alone", _truth("image")),
    "true_range_m": Field(_PIXELS, "m", "along the ray of each pixel", _truth("range_m")),
    "true_depth_m": Field(_PIXELS, "m", "along the optical axis", _truth("depth_m")),
    "true_reflectance": Field(_PIXELS, "1", "at the laser's wavelength", _truth("reflectance")),
    "true_spot_range_m": Field(_SPOTS, "m", "ranges of the spots", _truth("spot_range_m")),
}
