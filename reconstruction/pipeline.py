"""From a capture to image, ranges and depth map."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .capture import Capture, Optics, Unit
from .depth import anchored_range, nearest_range, pixel_of, pixel_rays
from .errors import InputError
from .image import pursuit_for, without_shared_errors, zero_filled
from .ranging import Ranges, measure_ranges

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
    the nearest spot. The maps are None where no spot is valid or the optics are unknown.
    ``timings_s``: seconds per stage. ``recording``: the digest of the capture, ``frame`` its frame
    and ``patterns`` the number of distinct ones that the image rests on.
    """

    image: Image
    image_zero_filled: Image
    ranges: Ranges | None
    range_m: Image | None
    depth_m: Image | None
    depth_nearest_m: Image | None
    timings_s: dict[str, float]
    unit: Unit
    recording: str
    frame: int
    patterns: int


def reconstruct(capture: Capture, frame: int = 0) -> Result:
    """Reconstruct one frame; InputError if there is no such frame or nothing usable in it."""
    if not 0 <= frame < capture.frames:
        raise InputError(f"frame {frame}: the capture has frames 0..{capture.frames - 1}")
    shape = capture.plan.shape
    timings: dict[str, float] = {}
    started = perf_counter()
    index, coefficients, noise = measured_coefficients(capture, frame)
    pursuit = pursuit_for(shape, index)
    timings["set-up"] = perf_counter() - started
    started = perf_counter()
    image = pursuit.reconstruct(coefficients, noise)
    timings["image"] = perf_counter() - started
    linear = zero_filled(shape, index, coefficients)
    if 0 not in index:  # the mean level is unknown: the darkest pixel is taken to be dark
        image -= image.min()
        linear -= linear.min()

    ranges = range_m = nearest_m = None
    if capture.spots is not None:
        started = perf_counter()
        ranges = measure_ranges(capture.spots, frame)
        timings["ranging"] = perf_counter() - started
        if capture.optics is not None:
            started = perf_counter()
            anchors = pixel_of(capture.spots.directions, capture.optics, shape)
            range_m = anchored_range(image, anchors, ranges.range_m, ranges.sigma_m)
            nearest_m = nearest_range(shape, anchors, ranges.range_m)
            timings["depth"] = perf_counter() - started
    return Result(
        image=image.astype(np.float32),
        image_zero_filled=linear.astype(np.float32),
        ranges=ranges,
        range_m=None if range_m is None else range_m.astype(np.float32),
        depth_m=_depth(range_m, capture.optics),
        depth_nearest_m=_depth(nearest_m, capture.optics),
        timings_s=timings,
        unit=capture.buckets.unit,
        recording=capture.digest,
        frame=frame,
        patterns=index.size,
    )


def measured_coefficients(capture: Capture, frame: int) -> tuple[NDArray[np.int32], Floats, float]:
    """Walsh-Hadamard coefficients in the unit of the signal: rows (K,), values (K,), their noise.

    Coefficients that rest on a saturated reading are left out, and errors that many share are
    taken off. The noise is the standard deviation of a typical coefficient, from shot noise and
    the electronics; where the latter is unknown it is 0, and every reading taken at its word.
    Raises InputError if nothing is left.
    """
    plan, buckets = capture.plan, capture.buckets
    usable = abs(plan.decoder) @ (~buckets.usable[frame]).astype(float) == 0
    if not usable.any():
        raise InputError(
            f"frame {frame}: every pattern rests on a saturated reading, so there is no image; "
            "record again with less light (projector power, exposure time) or a larger full scale"
        )
    index, decoder, signal = plan.distinct[usable], plan.decoder[usable], buckets.signal[frame]
    coefficients = decoder @ signal
    variance = buckets.variance[frame]
    if not np.isfinite(variance).all():
        return index, coefficients, 0.0
    prior = pursuit_for(plan.shape, index).prior_variance(coefficients)
    coefficients, variance = without_shared_errors(decoder, coefficients, variance, prior)
    return index, coefficients, float(np.sqrt(np.median(variance)))


def _depth(range_m: Floats | None, optics: Optics | None) -> Any:
    if range_m is None or optics is None:
        return None
    rays = pixel_rays(optics, (range_m.shape[0], range_m.shape[1]))
    return (range_m / np.linalg.norm(rays, axis=-1)).astype(np.float32)
