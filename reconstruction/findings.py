"""What about a capture its user should know before believing what is made of it."""

import numpy as np

from .capture import Capture
from .ranging import measure_ranges, unambiguous_path_m
from .spots import CwSpots

NO_RANGE = {
    "saturated": "is saturated",
    "no signal": "shows no signal",
    "too close": "is too close to tell its path from the way between laser and detector",
    "ambiguous": "may lie at several ranges: its readings contradict each other or lie at the edge",
}


def capture_warnings(capture: Capture, frame: int = 0) -> list[str]:
    """A sentence for each thing that spoils image or ranges of a frame; none if all is well."""
    return _image_warnings(capture, frame) + _spot_warnings(capture, frame)


def _image_warnings(capture: Capture, frame: int) -> list[str]:
    saturated = ~capture.buckets.usable[frame]
    if not saturated.any():
        return []
    return [
        f"{saturated.sum()} of {saturated.size} bucket readings ({100 * saturated.mean():.3g} %) "
        "are marked saturated: what rests on them is left out of the image"
    ]


def _spot_warnings(capture: Capture, frame: int) -> list[str]:
    if capture.spots is None:
        return []
    warnings = [
        f"spot {spot} {NO_RANGE[status]}: it gives no range"
        for spot, status in enumerate(measure_ranges(capture.spots, frame).status)
        if status != "ok"
    ]
    if capture.truth is not None and isinstance(capture.spots, CwSpots):
        farthest_m = unambiguous_path_m(capture.spots.tap_frequencies_hz) / 2
        warnings += [
            f"spot {spot} lies at {true_m:.2f} m, beyond the {farthest_m:.2f} m up to which a "
            "range is unambiguous: it is measured a multiple of that too near"
            for spot, true_m in enumerate(capture.truth.spot_range_m)
            if np.isfinite(true_m) and true_m > farthest_m
        ]
    return warnings
