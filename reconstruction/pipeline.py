"""From a capture to image, ranges and depth map."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from .capture import Capture, Optics, Unit
from .decoding import decode
from .depth import anchored_depth, nearest_range, pixel_of, pixel_rays
from .errors import InputError
from .image import pursuit_for, zero_filled
from .ranging import Ranges, dense_range, measure_ranges

Image = NDArray[np.float32]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Result:
    """What one frame shows; images are (H, W) float32.

    ``image``: what each virtual pixel contributes to an exposure, in ``unit`` (counts where their
    scale is unknown), by matching pursuit; ``image_zero_filled``: the linear baseline, of the same
    coefficients. ``ranges``: the four spots, None without time of
    flight. ``range_m`` along each pixel's ray and ``depth_m`` along the optical axis: the map
    anchored on the spots; ``depth_nearest_m``: the baseline in which each pixel takes the range of
    the nearest spot; both None where no spot is valid or the optics are unknown. ``range_dense_m``
    and ``depth_dense_m``: measured pixel by pixel, nan where it is too dark; None without taps of
    every pattern, or where the level of their light is not known.
    ``timings_s``: seconds per stage. ``recording``: the digest of the capture, ``frame`` its frame
    and ``patterns`` the number of distinct ones that the image rests on.
    """

    image: Image
    image_zero_filled: Image
    ranges: Ranges | None
    range_m: Image | None
    depth_m: Image | None
    depth_nearest_m: Image | None
    range_dense_m: Image | None
    depth_dense_m: Image | None
    timings_s: dict[str, float]
    unit: Unit
    recording: str
    frame: int
    patterns: int


def reconstruct(capture: Capture, frame: int = 0) -> Result:
    """Reconstruct one frame; InputError if there is no such frame or nothing usable in it."""
    if not 0 <= frame < capture.frames:
        raise InputError(f"frame {frame}: the capture has frames 0..{capture.frames - 1}")
    plan, spots, optics = capture.plan, capture.spots, capture.optics
    timings: dict[str, float] = {}
    with _timed(timings, "set-up"):
        index, coefficients, noise = measured_coefficients(capture, frame)
        pursuit = pursuit_for(plan.shape, index)
    with _timed(timings, "image"):
        image = pursuit.reconstruct(coefficients, noise)
    linear = zero_filled(plan.shape, index, coefficients)
    if 0 not in index:  # the mean level is unknown: the darkest pixel is taken to be dark
        image -= image.min()
        linear -= linear.min()

    ranges = depth_m = nearest_m = dense_m = None
    if spots is not None:
        with _timed(timings, "ranging"):
            ranges = measure_ranges(spots, frame)
    if spots is not None and ranges is not None and optics is not None:
        with _timed(timings, "depth"):
            anchors = pixel_of(spots.directions, optics, plan.shape)
            forward = spots.directions[:, 2]
            depth_m = anchored_depth(
                image, anchors, ranges.range_m * forward, ranges.sigma_m * forward
            )
            nearest_m = nearest_range(plan.shape, anchors, ranges.range_m)
    if capture.pattern_taps is not None and optics is not None:
        with _timed(timings, "dense ranging"):
            dense_m = dense_range(capture.pattern_taps, plan, optics, frame)
    stretch = _stretch(optics, plan.shape)
    return Result(
        image=image.astype(np.float32),
        image_zero_filled=linear.astype(np.float32),
        ranges=ranges,
        range_m=_single(depth_m, stretch),
        depth_m=_single(depth_m),
        depth_nearest_m=_single(nearest_m, 1 / stretch),
        range_dense_m=_single(dense_m),
        depth_dense_m=_single(dense_m, 1 / stretch),
        timings_s=timings,
        unit=capture.buckets.unit,
        recording=capture.digest,
        frame=frame,
        patterns=index.size,
    )


def measured_coefficients(capture: Capture, frame: int) -> tuple[NDArray[np.int32], Floats, float]:
    """Walsh-Hadamard coefficients of the image, as `decode` gives them.

    Raises InputError if every one rests on a saturated reading.
    """
    buckets = capture.buckets
    index, coefficients, noise = decode(
        capture.plan, buckets.signal[frame], buckets.variance[frame], buckets.usable[frame]
    )
    if not index.size:
        raise InputError(
            f"frame {frame}: every pattern rests on a saturated reading, so there is no image; "
            "record again with less light (projector power, exposure time) or a larger full scale"
        )
    return index, coefficients, noise


@contextmanager
def _timed(timings_s: dict[str, float], stage: str) -> Iterator[None]:
    started = perf_counter()
    yield
    timings_s[stage] = perf_counter() - started


def _stretch(optics: Optics | None, shape: tuple[int, int]) -> Floats | float:
    """Range over depth of each pixel."""
    return 1.0 if optics is None else np.linalg.norm(pixel_rays(optics, shape), axis=-1)


def _single(image: Floats | None, factor: Floats | float = 1.0) -> Image | None:
    return None if image is None else np.asarray(image * factor, dtype=np.float32)
