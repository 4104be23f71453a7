"""What about a capture its user should know before believing what is made of it."""

import numpy as np

from .capture import Capture, FrameTruth
from .operators import decoder_for
from .ranging import RANGING_METHODS, measure_ranges, unambiguous_path_m

NO_RANGE = {
    "saturated": "is saturated",
    "no signal": "shows no signal",
    "too close": "is too close to tell its path from the way between laser and detector",
    "weak": "is too weak to tell from noise and fog",
    "fog": "is lost in fog: its range is too uncertain",
    "ambiguous": "is ambiguous (its frequencies disagree, or its pulse may lie outside of windows)",
}


def capture_warnings(capture: Capture, frame: int | None = None) -> list[str]:
    """A sentence for each thing that spoils image or ranges of a frame, or of any if None."""
    frames = range(capture.frames) if frame is None else [frame]
    found = (
        warning
        for number in frames
        for warnings in (_image_warnings, _spot_warnings, _pattern_tap_warnings)
        for warning in warnings(capture, number)
    )
    return list(dict.fromkeys(found))


def _image_warnings(capture: Capture, frame: int) -> list[str]:
    saturated = ~capture.buckets.usable[frame]
    if not saturated.any():
        return []
    return [
        f"{saturated.sum()} of {saturated.size} bucket readings ({100 * saturated.mean():.3g} %) "
        "are marked saturated: what rests on them is left out of the image"
    ]


def _spot_warnings(capture: Capture, frame: int) -> list[str]:
    spots = capture.spots
    if spots is None:
        return []
    warnings = [
        f"spot {spot} {NO_RANGE[status]}: it gives no range"
        for spot, status in enumerate(measure_ranges(spots, frame).status)
        if status != "ok"
    ]
    truth = _truth(capture, frame)
    if truth is not None:
        farthest_m = RANGING_METHODS[spots.method].unambiguous_range_m(spots)
        warnings += [
            f"spot {spot} lies at {true_m:.2f} m, beyond the {farthest_m:.2f} m up to which a "
            "range is unambiguous: it is measured a multiple of that too near"
            for spot, true_m in enumerate(truth.spot_range_m)
            if np.isfinite(true_m) and true_m > farthest_m
        ]
    return warnings


def _pattern_tap_warnings(capture: Capture, frame: int) -> list[str]:
    if capture.pattern_taps is None:
        return []
    saturated = capture.pattern_taps.saturated[frame].any(axis=-1)
    warnings = []
    if saturated.any():
        warnings.append(
            f"the taps of {saturated.sum()} of {saturated.size} exposures "
            f"({100 * saturated.mean():.3g} %) are marked saturated: what rests on them is left "
            "out of the dense ranges"
        )
    warnings += _wrapped_pixels(capture, frame)
    if capture.optics is None:
        warnings.append("the optics are not known: there are no dense ranges")
    elif not decoder_for(capture.setup.plan_of(frame), ~saturated).level:
        warnings.append(
            "pattern 0, the level of all light, is not shown or saturated: there are no dense "
            "ranges"
        )
    return warnings


def _wrapped_pixels(capture: Capture, frame: int) -> list[str]:
    truth = _truth(capture, frame)
    if truth is None or capture.pattern_taps is None:
        return []
    farthest_m = unambiguous_path_m(capture.pattern_taps.tap_frequencies_hz) / 2
    beyond = truth.range_m > farthest_m
    if not beyond.any():
        return []
    return [
        f"the scene reaches to {np.nanmax(truth.range_m):.2f} m, beyond the "
        f"{farthest_m:.2f} m up to which a dense range is unambiguous: {100 * beyond.mean():.3g} % "
        "of the pixels are measured a multiple of that too near"
    ]


def _truth(capture: Capture, frame: int) -> FrameTruth | None:
    """The truth of one frame, None where it is not known."""
    truth = capture.truth
    return None if truth is None or not truth.knows(frame) else truth.at(frame)
