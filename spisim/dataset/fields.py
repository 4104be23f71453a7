"""Named arrays of a capture, recorded in it or derived from it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture, Reconstructor
from reconstruction.base.errors import naming
from reconstruction.chosen_methods import carries
from reconstruction.default_ranging import SetupKey, default_ranges
from reconstruction.depth import DEPTH_METHODS
from reconstruction.exports.shot import Intrinsics
from reconstruction.image import image_method

Array = NDArray[Any]
Read = Callable[[Capture], Array | None]


@dataclass(frozen=True)
class Field:
    """A named array of captures; `read` returns None if a capture lacks it.

    `recorded` is false if the array has to be reconstructed, or needs the scene to be loaded.
    """

    dims: tuple[str, ...]
    dtype: str
    units: str
    meaning: str
    read: Read
    recorded: bool = True


def find_field(name: str) -> Field | None:
    """Return the field of a name, as in FIELDS or with a method as in "depth_m.anchored".

    Returns None if there is none. Raises InputError for an unknown method.
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


def _pointing(capture: Capture) -> Array | None:
    if capture.spots is None:
        return None
    shape = (capture.frames, *capture.spots.directions.shape)
    fixed = np.broadcast_to(capture.spots.directions, shape)
    return fixed if capture.spots.pointing is None else capture.spots.pointing


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
        unknown = np.full(len(capture.spots.directions), np.nan)
        return np.stack([unknown if each is None else getattr(each, name) for each in frames])

    return read


def _finite(read: Read) -> Read:
    def is_finite(capture: Capture) -> Array | None:
        values = read(capture)
        return None if values is None else np.isfinite(values)

    return is_finite


def _poses(capture: Capture) -> Array | None:
    from spisim.dataset.poses import placed

    frames = [placed(capture, frame) for frame in range(capture.frames)]
    poses = [frame.pose for frame in frames if frame is not None]
    return np.stack(poses) if poses else None


def _intrinsics(capture: Capture) -> Array | None:
    optics = capture.optics
    return None if optics is None else Intrinsics.of(optics, capture.plan.shape).matrix


@lru_cache(maxsize=4)
def _compiled(setup: SetupKey, image: str | None, depth: str | None) -> Reconstructor:
    """Return a reconstructor of an image method, or of a depth method; None is the default."""
    if depth == "":
        return Reconstructor(setup.setup, image=image, ranging=(), depth=())
    return Reconstructor(setup.setup, depth=depth)


def _frames(capture: Capture, image: str | None, depth: str | None, name: str) -> Array | None:
    # A method that carries state between frames needs a new reconstructor for each capture.
    depths = () if depth == "" else depth
    carrying = carries(capture.setup, image=image, depth=depths)
    compiled = _compiled.__wrapped__ if carrying else _compiled
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
    "image by the default method; `image.METHOD` by another method",
    lambda capture: _frames(capture, None, "", "image"),
    recorded=False,
)
_DEPTH = Field(
    _PIXELS,
    "float32",
    "m",
    "depth along the optical axis by the default method; `depth_m.METHOD` by another method",
    lambda capture: _frames(capture, None, None, "depth_m"),
    recorded=False,
)


def _image_by(method: str) -> Field:
    image_method(method)
    return replace(
        _IMAGE,
        meaning=f"image by {method}",
        read=lambda capture: _frames(capture, method, "", "image"),
    )


def _depth_by(method: str) -> Field:
    DEPTH_METHODS[method]
    return replace(
        _DEPTH,
        meaning=f"depth along the optical axis by {method}",
        read=lambda capture: _frames(capture, None, method, "depth_m"),
    )


_RECONSTRUCTED = {"image": _image_by, "depth_m": _depth_by}

FIELDS = {
    "buckets": Field(
        _EXPOSURES,
        "float64",
        "electron",
        "signal of each exposure; counts if the conversion gain is unknown",
        lambda capture: capture.buckets.signal,
    ),
    "saturated": Field(
        _EXPOSURES,
        "bool",
        "1",
        "mask of unusable exposures",
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
        "unit vectors of the spots, mirrors at rest: right, down, forward of the camera",
        _spots("directions"),
    ),
    "spot_pointing": Field(
        (*_SPOTS, "axis"),
        "float64",
        "1",
        "unit vectors of the spots in each frame, as mirrors read them",
        _pointing,
    ),
    "spot_range_m": Field(
        _SPOTS,
        "float64",
        "m",
        "measured ranges of the spots; nan for no return",
        _ranges("range_m"),
    ),
    "spot_sigma_m": Field(
        _SPOTS, "float64", "m", "standard error of the measured ranges", _ranges("sigma_m")
    ),
    "spot_known": Field(
        _SPOTS, "bool", "1", "mask of spots with a range", _finite(_ranges("range_m"))
    ),
    "image": _IMAGE,
    "depth_m": _DEPTH,
    "intrinsics": Field(
        ("pixel", "ray"),
        "float64",
        "pixel",
        "3 × 3 camera matrix, from rays to pixel columns and rows",
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
        _PIXELS, "float32", "electron", "signal of each pixel alone", _truth("image")
    ),
    "true_range_m": Field(
        _PIXELS,
        "float32",
        "m",
        "true range along the ray of each pixel; nan where no surface is hit",
        _truth("range_m"),
    ),
    "true_depth_m": Field(
        _PIXELS,
        "float32",
        "m",
        "true depth along the optical axis; nan where no surface is hit",
        _truth("depth_m"),
    ),
    "true_depth_known": Field(
        _PIXELS, "bool", "1", "mask of pixels that hit a surface", _finite(_truth("depth_m"))
    ),
    "true_reflectance": Field(
        _PIXELS, "float32", "1", "reflectance at the laser wavelength", _truth("reflectance")
    ),
    "true_spot_range_m": Field(
        _SPOTS, "float64", "m", "true ranges of the spots", _truth("spot_range_m")
    ),
}
"""All fields; `find_field` adds `image` and `depth_m` by other methods."""
