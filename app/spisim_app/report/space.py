"""Data for the point cloud of a depth map in a page."""

from dataclasses import dataclass

from reconstruction import Capture, Result
from reconstruction.depth import MAX_RANGE_M
from reconstruction.ranging import RANGED

from .style import VARIABLES, spot_looks

#: Titles by the kind of map.
KINDS = {
    "depth": "depth",
    "image": "image",
    "error": "error of depth",
    "deviation": "sigma of depth",
    "nothing": "probability of no return",
}


@dataclass(frozen=True)
class Space:
    """Size of the maps, half their field of view, and the measured spots in the camera frame."""

    width: int
    height: int
    tan_x: float
    tan_y: float
    spots: list[dict[str, object]]
    kinds: dict[str, str]
    max_range_m: float = MAX_RANGE_M

    @classmethod
    def of(cls, capture: Capture, result: Result) -> "Space | None":
        """Return None without optics or a depth map."""
        if capture.optics is None or not result.depths:
            return None
        height, width = capture.plan.shape
        truths = capture.truth
        there = {
            "depth": True,
            "image": True,
            "error": truths is not None and truths.knows(result.frame),
            "deviation": bool(result.log_depth_sigmas),
            "nothing": bool(result.no_returns),
        }
        return cls(
            width,
            height,
            capture.optics.tan_half_width,
            capture.optics.tan_half_height,
            _spots(capture, result),
            {kind: words for kind, words in KINDS.items() if there[kind]},
        )


def _spots(capture: Capture, result: Result) -> list[dict[str, object]]:
    spots = result.aimed(capture.setup).spots
    if spots is None or result.ranges is None:
        return []
    points = result.ranges.range_m[:, None] * spots.directions
    statuses = zip(points.tolist(), result.ranges.status, strict=True)
    return [
        {"colour": VARIABLES[colour], "at": [round(value, 4) for value in at]}
        for (colour, _), (at, status) in zip(spot_looks(len(points)), statuses, strict=True)
        if status in RANGED
    ]
