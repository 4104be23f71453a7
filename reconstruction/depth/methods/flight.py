"""Depth map of a flight: that of the frame, with what earlier frames have met.

For recordings whose frames have poses and are reconstructed in order. The map of the frame alone is
the learned one, or what stands in for it; see `reconstruction.depth.memory`. A frame without a pose
gets its own map; after a jump the memory begins anew.
"""

from dataclasses import replace

import numpy as np

from ...base.arrays import Floats
from ...capture.motion import pose_at
from ...capture.readings.cw import CwSpots
from ...ranging import RANGED, Ranges
from ..ahead import Ahead
from ..memory import FlightMemory, FrameRanges, Possible, Remembered
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..network_input import NetworkInput
from ..pixels import pixel_rays
from .learned import METHOD as LEARNED
from .learned import FrameMap, decided

DECIDABLE = (*RANGED, "ambiguous")
"""Statuses of spots with a target, whose range the depth map may decide."""


class Flight:
    """Depth from a frame and those before it."""

    title = "flight memory"
    needs: tuple[Need, ...] = ("optics", "spots", "poses")
    carries = True

    def compile(self, context: Context) -> DepthSolver:
        setup = context.setup
        assert setup.optics is not None
        alone = LEARNED.compile(context)
        memory = FlightMemory(setup.optics, setup.plan.shape)
        rays = pixel_rays(setup.optics, setup.plan.shape)

        def solve(view: View) -> DepthEstimate | None:
            whole, pose = alone.frame_map(view), pose_at(view.frame.poses)
            if whole is None:
                return None
            if pose is not None:
                remembered = memory.take(pose, view.image, whole.estimate, ranges_of(view, whole))
                result = stated(remembered, whole, rays)
                return replace(
                    result,
                    points_m=remembered.points_m,
                    points_log_sigma=remembered.points_log_sigma,
                )
            note = "of the frame alone, as it has no pose"
            fallback = alone(view)
            return fallback and replace(fallback, note=_joined(note, fallback.note))

        return solve


def ranges_of(view: View, whole: FrameMap) -> FrameRanges:
    """Ranges of a frame, and which are possible: of continuous wave, as the network's input is."""
    assert view.ranges is not None
    ranges, frame, possible = view.ranges, whole.frame, None
    if any(ranges.alternatives) and isinstance(view.frame.spots, CwSpots):
        decidable = np.isin(ranges.status, DECIDABLE)
        possible = Possible.of(
            [some if may else () for some, may in zip(ranges.alternatives, decidable, strict=True)],
            np.inf if frame is None else frame.max_range_m,
        )
    elif frame is not None:
        possible = _wrapped(view, ranges, frame)
    lost = None if frame is None else frame.lost
    return FrameRanges(view.directions, ranges.range_m, ranges.sigma_m, possible, lost)


def _wrapped(view: View, ranges: Ranges, frame: NetworkInput) -> Possible:
    """Plain ranges and their multiples, by reflectances that are known for the fitted ranges."""
    extinction_per_m = float(np.nan_to_num(frame.extinction_per_m))
    best_m = np.exp(frame.best.log_depth) / view.directions[:, 2]
    nearer = 2 * np.log(ranges.range_m / best_m)
    nearer += 2 * extinction_per_m * (ranges.range_m - best_m)
    return Possible.wrapped(
        ranges.range_m,
        ranges.sigma_m,
        frame.log_reflectance + nearer,
        frame.max_range_m,
        extinction_per_m,
    )


def stated(remembered: Remembered, whole: FrameMap, rays: Floats) -> DepthEstimate:
    """A map with the memory, with its corridors and a note."""
    result, anew, late_s = remembered.estimate, remembered.begun_anew, remembered.late_s
    note = _joined(
        None if anew is None else f"begun anew: {anew}",
        _clock_note(late_s) if late_s else None,
        whole.estimate.note,
    )
    if not np.isfinite(result.depth_m).any():
        return replace(result, note=note)
    return replace(decided(result, Ahead.of(result, rays, prior_of(whole))), note=note)


def prior_of(whole: FrameMap) -> str:
    """Name of the error model of corridors, that of the frame's own map.

    Constants fitted to flights were worse in worlds of other families: flights are many frames,
    but few worlds.
    """
    return "learned" if whole.frame else "others"


def _clock_note(late_s: float) -> str:
    which = "late" if late_s > 0 else "early"
    return f"from corrected poses, as those stated seem {abs(late_s):.2f} s {which}"


def _joined(*notes: str | None) -> str | None:
    return "; ".join(filter(None, notes)) or None


METHOD = Flight()
