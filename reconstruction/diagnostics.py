"""Warnings about a capture: what makes its image or ranges wrong, uncertain or missing."""

from collections.abc import Sequence

import numpy as np

from .base.errors import InputError
from .capture import Capture, Frames, FrameTruth
from .default_ranging import default_ranges
from .image import Imaging, plan_inconsistency
from .operators import decoder_for
from .ranging import RANGED, RANGING_METHODS, Ranges, unambiguous_path_m
from .ranging.consistency import MIN_DIFFERENCE_M
from .result import Result

ENOUGH = 0.9**2 / (1 - 0.9**2)
"""Squared SNR of a coefficient at which the zero-filled image is correlated with the truth 0.9
times as much as without noise: the correlation has the factor 1 / sqrt(1 + 1 / SNR^2)."""

NOT_TRACED = (
    "the light of this simulation is a fast surrogate, not traced: use it to train methods, not to "
    "judge them"
)

MAX_UNUSABLE = 0.05
"""Largest fraction of unusable readings with which the plan is still checked."""

BIASED = 5.0
"""Error in standard deviations that noise alone does not explain."""

NO_RANGE = {
    "saturated": "is saturated",
    "no signal": "has no signal",
    "too close": "is too close: its path is no longer than the baseline from laser to detector",
    "weak": "is too weak to separate from noise and fog",
    "fog": "is lost in fog: its range is too uncertain",
    "uneven fog": "is lost in uneven fog: the spots do not share one",
    "ambiguous": "is ambiguous (several ranges explain it, or none does)",
}


def capture_warnings(
    capture: Capture, frame: int | None = None, ranges: Ranges | None = None
) -> list[str]:
    """Warn about everything that makes an image or ranges wrong, uncertain or missing.

    Parameters
    ----------
    capture
        A capture in memory.
    frame
        Index of the frame to check; every frame if None.
    ranges
        Ranges of this frame that the user sees; the default ones if None.

    Returns
    -------
    list of str
        One sentence for each problem, the same for several frames only once.
    """
    frames = range(capture.frames) if frame is None else [frame]
    by_frame = (
        warning
        for number in frames
        for warnings in (
            _image_warnings(capture, number),
            _spot_warnings(capture, number, ranges),
            _pattern_tap_warnings(capture, number),
        )
        for warning in warnings
    )
    return [
        *([NOT_TRACED] if capture.provenance.is_surrogate else []),
        *_layout_warnings(capture, frames[0]),
        *_pattern_warnings(capture),
        *_noise_warnings(capture, frames),
        *dict.fromkeys(by_frame),
    ]


def result_warnings(result: Result, capture: Capture) -> list[str]:
    """Warnings about the frame of a result, given its ranges, and about its methods."""
    return [*capture_warnings(capture, result.frame, result.ranges), *result.warnings]


def _layout_warnings(capture: Capture, frame: int) -> list[str]:
    """Warn if readings contradict the pattern plan, which is certain only in simulations."""
    signal, usable = capture.buckets.signal[frame], capture.buckets.usable[frame]
    if capture.provenance.source == "simulation" or usable.mean() < 1 - MAX_UNUSABLE:
        return []
    filled = np.where(usable, signal, np.median(signal[usable]))
    doubtful = plan_inconsistency(capture.plan, filled[None])
    return [] if doubtful is None else [doubtful]


def _pattern_warnings(capture: Capture) -> list[str]:
    """Warn if all patterns are the same one."""
    index = np.concatenate([plan.index for plan in capture.setup.plans])
    if np.ptp(index) > 0 or not capture.plan.shows_image:
        return []
    return [f"all {index.size} exposures show pattern {index[0]}: there is no image in them"]


def _noise_warnings(capture: Capture, frames: Sequence[int]) -> list[str]:
    """Warn about frames whose coefficients are more noise than image."""
    imaging = Imaging(capture.plan)
    try:
        estimated = [_coefficient_snr(imaging, capture.frame(number)) for number in frames]
    except InputError as error:
        return [f"there is no image: {error}"]
    weak = [each for each in estimated if each is not None and each < 1]
    if not weak:
        return []
    typical = float(np.median(weak))
    which = "there is" if len(frames) == 1 else f"in {len(weak)} of {len(frames)} frames there is"
    return [
        f"{which} hardly an image: signal over noise is about {typical:.2g} per coefficient, so "
        "that a flat image is closer to the truth than the zero-filled one; average about "
        f"{np.ceil(ENOUGH / typical**2):.0f} frames for 90 % of the correlation with the truth "
        "that these patterns allow"
    ]


def _coefficient_snr(imaging: Imaging, frame: Frames) -> float | None:
    """SNR of all coefficients but DC; None if it is unknown or no reading is usable."""
    buckets = frame.buckets
    readings = imaging.of(buckets.usable[0])
    varying = readings.decoder.operator.varying & readings.measured
    if not np.isfinite(buckets.variance).any() or not varying.any():
        return None
    return readings.decode(buckets.signal[0], buckets.variance[0]).signal_over_noise(varying)


def _image_warnings(capture: Capture, frame: int) -> list[str]:
    usable = capture.buckets.usable[frame]
    if usable.sum() > 1 and np.ptp(capture.buckets.counts[frame][usable]) == 0:
        return [f"all {usable.sum()} bucket readings are equal: there is no image in them"]
    saturated = ~usable
    if not saturated.any():
        return []
    return [
        f"{saturated.sum()} of {saturated.size} bucket readings ({100 * saturated.mean():.3g} %) "
        "are marked saturated: the image does without the coefficients that they measure"
    ]


def _spot_warnings(capture: Capture, frame: int, ranges: Ranges | None) -> list[str]:
    spots = capture.spots
    if spots is None:
        return []
    ranges = default_ranges(capture, frame) if ranges is None else ranges
    if ranges is None:
        return []
    warnings = [
        f"spot {spot} {NO_RANGE[status]}: it has no range"
        for spot, status in enumerate(ranges.status)
        if status not in RANGED
    ]
    truth = _truth(capture, frame)
    if truth is not None:
        max_m = RANGING_METHODS[spots.method].unambiguous_range_m(spots)
        off_m = ranges.range_m - truth.spot_range_m
        limit_m = np.maximum(BIASED * ranges.sigma_m, MIN_DIFFERENCE_M)
        wrong = ranges.valid & ~(np.abs(off_m) <= limit_m)
        warnings += [
            f"spot {spot} {_wrong(true_m, off_m[spot], ranges.sigma_m[spot], max_m)}"
            for spot, true_m in enumerate(truth.spot_range_m.tolist())
            if wrong[spot]
        ]
    return warnings


def _wrong(true_m: float, off_m: float, sigma_m: float, max_m: float) -> str:
    """How wrong a range is that noise alone does not explain, and why."""
    if np.isnan(true_m):
        return "hits no surface: its range is that of noise or fog"
    if true_m > max_m:
        return (
            f"lies at {true_m:.2f} m, beyond the maximum unambiguous range of {max_m:.2f} m: it is "
            f"measured {abs(off_m):.2f} m too {_way(off_m)}"
        )
    return (
        f"is measured {abs(off_m):.2f} m too {_way(off_m)}, with a sigma of {sigma_m:.2g} m: "
        "fog or further echoes bias it"
    )


def _way(off_m: float) -> str:
    return "far" if off_m > 0 else "near"


def _pattern_tap_warnings(capture: Capture, frame: int) -> list[str]:
    if capture.pattern_taps is None:
        return []
    saturated = capture.pattern_taps.saturated[frame].any(axis=-1)
    warnings = []
    if saturated.any():
        warnings.append(
            f"the taps of {saturated.sum()} of {saturated.size} exposures "
            f"({100 * saturated.mean():.3g} %) are marked saturated: dense ranges do without them"
        )
    warnings += _wrapped_pixels(capture, frame)
    if capture.optics is None:
        warnings.append("the optics are unknown: there are no dense ranges")
    elif not decoder_for(capture.setup.plan_of(frame), ~saturated).has_dc:
        warnings.append(
            "pattern 0, the DC coefficient, is not exposed or saturated: there are no dense ranges"
        )
    return warnings


def _wrapped_pixels(capture: Capture, frame: int) -> list[str]:
    truth = _truth(capture, frame)
    if truth is None or capture.pattern_taps is None:
        return []
    max_m = unambiguous_path_m(capture.pattern_taps.tap_frequencies_hz) / 2
    beyond = truth.range_m > max_m
    if not beyond.any():
        return []
    return [
        f"the scene extends to {np.nanmax(truth.range_m):.2f} m, beyond the maximum unambiguous "
        f"range of {max_m:.2f} m: {100 * beyond.mean():.3g} % of the pixels are measured too near "
        "by a multiple of that"
    ]


def _truth(capture: Capture, frame: int) -> FrameTruth | None:
    """The truth of one frame, None if it is unknown."""
    truth = capture.truth
    return None if truth is None or not truth.knows(frame) else truth.at(frame)
