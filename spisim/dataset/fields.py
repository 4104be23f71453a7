"""Arrays that a capture holds, or that are made of it, under the names of a data set."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture, Reconstructor
from reconstruction.base.errors import naming
from reconstruction.chosen_methods import warm_up_frames
from reconstruction.default_ranging import SetupKey, default_ranges
from reconstruction.depth import DEPTH_METHODS
from reconstruction.exports.shot import Intrinsics
from reconstruction.image import image_method

Array = NDArray[Any]
Read = Callable[[Capture], Array | None]


@dataclass(frozen=True)
class Field:
    """An array of every capture; `read` gives None where a capture lacks it.

    `recorded`: it follows from the capture at once; otherwise it is reconstructed, or its scene
    drawn again.
    """

    dims: tuple[str, ...]
    dtype: str
    units: str
    meaning: str
    read: Read
    recorded: bool = True


def find_field(name: str) -> Field | None:
    """The field of this name, as in FIELDS or with a method as in "depth_m.anchored"; None if none.

    Raises InputError, telling the nearest, for methods that there are not.
    """
    if name in FIELDS:
        return FIELDS[name]
    base, _, method = name.partition(".")
    if base not in _RECONSTRUCTED:
        return None
    with naming(name):
        return _RECONSTRUCTED[base](method)


def _spots(name: str) -> Read:
    return lambda capture: None if capture.spots is None else getattr(capture.spots, name)


def _truth(name: str) -> Read:
    def read(capture: Capture) -> Array | None:
        truth = capture.truth
        if truth is None:
            return None
        return np.stack([getattr(truth.at(frame), name) for frame in range(capture.frames)])

    return read


def _ranges(name: str) -> Read:
    def read(capture: Capture) -> Array | None:
        if capture.spots is None:
            return None
        frames = [default_ranges(capture, frame) for frame in range(capture.frames)]
        unknown = np.full(4, np.nan)
        return np.stack([unknown if each is None else getattr(each, name) for each in frames])

    return read


def _is_available(read: Read) -> Read:
    def known(capture: Capture) -> Array | None:
        values = read(capture)
        return None if values is None else np.isfinite(values)

    return known


def _poses(capture: Capture) -> Array | None:
    from spisim.dataset.shots import placed

    frames = [placed(capture, frame) for frame in range(capture.frames)]
    poses = [frame.pose for frame in frames if frame is not None]
    return np.stack(poses) if poses else None


def _intrinsics(capture: Capture) -> Array | None:
    optics = capture.optics
    return None if optics is None else Intrinsics.of(optics, capture.plan.shape).matrix


@lru_cache(maxsize=4)
def _compiled(setup: SetupKey, image: str | None, depth: str | None) -> Reconstructor:
    """Of a method of images, or one of depth maps; None is the default of the recording."""
    if depth == "":
        return Reconstructor(setup.setup, image=image, ranging=(), depth=())
    return Reconstructor(setup.setup, depth=depth)


def _frames(capture: Capture, image: str | None, depth: str | None, name: str) -> Array | None:
    compiled = (
        _compiled.__wrapped__ if warm_up_frames(1, image) else _compiled
    )  # which must not remember
    reconstruct = compiled(SetupKey(capture.setup), image, depth)
    maps = [getattr(reconstruct(capture.frame(frame)), name) for frame in range(capture.frames)]
    return None if maps[0] is None else np.stack(maps)


_EXPOSURES = ("frame", "exposure")
_SPOTS = ("frame", "spot")
_PIXELS = ("frame", "row", "column")

_IMAGE = Field(
    _PIXELS,
    "float32",
    "electron",
    "image as reconstructed by default; `image.METHOD` by another method",
    lambda capture: _frames(capture, None, "", "image"),
    recorded=False,
)
_DEPTH = Field(
    _PIXELS,
    "float32",
    "m",
    "depth along the optical axis as reconstructed by default; `depth_m.METHOD` by another method",
    lambda capture: _frames(capture, None, None, "depth_m"),
    recorded=False,
)


def _image_by(method: str) -> Field:
    image_method(method)
    return replace(
        _IMAGE,
        meaning=f"image as reconstructed by {method}",
        read=lambda capture: _frames(capture, method, "", "image"),
    )


def _depth_by(method: str) -> Field:
    DEPTH_METHODS[method]
    return replace(
        _DEPTH,
        meaning=f"depth along the optical axis as reconstructed by {method}",
        read=lambda capture: _frames(capture, None, method, "depth_m"),
    )


_RECONSTRUCTED = {"image": _image_by, "depth_m": _depth_by}

FIELDS = {
    "buckets": Field(
        _EXPOSURES,
        "float64",
        "electron",
        "light of each exposure; counts where their scale is unknown",
        lambda capture: capture.buckets.signal,
    ),
    "saturated": Field(
        _EXPOSURES,
        "bool",
        "1",
        "mask of the exposures that must not be used",
        lambda capture: ~capture.buckets.usable,
    ),
    "spot_readings": Field(
        (*_SPOTS, "tap"),
        "float64",
        "count",
        "taps of the spots, or bins of their histograms",
        _spots("readings"),
    ),
    "spot_directions": Field(
        ("spot", "axis"),
        "float64",
        "1",
        "unit vectors of the spots: right, down, forward of the camera",
        _spots("directions"),
    ),
    "spot_range_m": Field(
        _SPOTS,
        "float64",
        "m",
        "measured ranges of the spots; nan where there is none",
        _ranges("range_m"),
    ),
    "spot_sigma_m": Field(_SPOTS, "float64", "m", "their standard deviation", _ranges("sigma_m")),
    "spot_known": Field(
        _SPOTS, "bool", "1", "mask of the spots with a range", _is_available(_ranges("range_m"))
    ),
    "image": _IMAGE,
    "depth_m": _DEPTH,
    "intrinsics": Field(
        ("pixel", "ray"),
        "float64",
        "pixel",
        "3 × 3 matrix of the camera, from rays to columns and rows of pixels",
        _intrinsics,
    ),
    "pose": Field(
        ("frame", "world", "camera"),
        "float64",
        "1; m in the last column",
        "4 × 4 matrix from the camera (right, down, forward) to the world, z up",
        _poses,
        recorded=False,
    ),
    "true_image": Field(
        _PIXELS, "float32", "electron", "electrons of each pixel alone", _truth("image")
    ),
    "true_range_m": Field(
        _PIXELS,
        "float32",
        "m",
        "along the ray of each pixel; nan where nothing is hit",
        _truth("range_m"),
    ),
    "true_depth_m": Field(
        _PIXELS,
        "float32",
        "m",
        "along the optical axis; nan where nothing is hit",
        _truth("depth_m"),
    ),
    "true_depth_known": Field(
        _PIXELS,
        "bool",
        "1",
        "mask of the pixels that hit something",
        _is_available(_truth("depth_m")),
    ),
    "true_reflectance": Field(
        _PIXELS, "float32", "1", "at the laser's wavelength", _truth("reflectance")
    ),
    "true_spot_range_m": Field(
        _SPOTS, "float64", "m", "true ranges of the spots", _truth("spot_range_m")
    ),
}
"""All of them; `image` and `depth_m` by other methods are found by `find_field`."""
