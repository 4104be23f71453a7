"""What the memory of a flight makes of its frames, by the error of the poses.

A flight is reconstructed once, frame by frame; its memory is run for every kind of pose error.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from flight_sets import POSE_ERRORS, Flight, load, with_error

from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture
from reconstruction.capture.motion import pose_at
from reconstruction.depth import MAX_RANGE_M, Context, Corridor, DepthEstimate, View, pixel_rays
from reconstruction.depth.ahead import Ahead
from reconstruction.depth.memory import FlightMemory, Remembered
from reconstruction.depth.memory.clock import ClockOffset
from reconstruction.depth.methods.flight import prior_of, ranges_of
from reconstruction.depth.methods.learned import METHOD as LEARNED
from reconstruction.depth.methods.learned import FrameMap

WARM_UP_S = 0.35
"""Frames before that are not judged, unless a figure says from when on."""
FULL_S = 1.0
"""From then on a flight has met about as many points as are ever in view."""
SINGLE = "single frame"


@dataclass(frozen=True, eq=False)
class Judged:
    """A frame's map against the truth: mean relative error, fraction within 2 sigma, corridor.

    ``obstacle_m`` is the distance of the nearest thing in the corridor that counts as one, by the
    depth of the pixels in view; ``surface_m`` that of anything, however thin or out of view. Nan
    is for none.
    """

    time_s: float
    abs_rel: float
    within: float
    obstacle_m: float
    surface_m: float
    free: Floats
    deviations: Floats


@dataclass(frozen=True, eq=False)
class JudgedFlight:
    """Judged frames by kind of pose error, and of the single frame.

    ``memory_s`` is the processor time that the memory takes in a frame with a map after `FULL_S`:
    the mean, and of that the least over the kinds, as other programs only add to it. Nan is for no
    such frame.
    """

    flight: Flight
    frames: Mapping[str, Sequence[Judged]]
    memory_s: float

    def mean(self, kind: str, figure: str, from_s: float = WARM_UP_S) -> float:
        """Mean of a figure over frames."""
        values = [getattr(each, figure) for each in self.frames[kind] if each.time_s >= from_s]
        return float(np.mean(values)) if values else float("nan")


@dataclass(eq=False)
class _Watched:
    """The learned method, which keeps the maps that it makes, before any pixel is dropped."""

    made: list[tuple[View, FrameMap | None]] = field(default_factory=list)
    name = "watched"
    needs = LEARNED.needs

    def compile(self, context: Context):  # type: ignore[no-untyped-def]
        """Solver that adds to `made`."""
        solver = LEARNED.compile(context)

        def solve(view: View) -> DepthEstimate | None:
            whole = solver.frame_map(view)
            self.made.append((view, whole))
            return whole and whole.estimate

        return solve


def judge(flight: Flight, kinds: Sequence[str] = tuple(POSE_ERRORS)) -> JudgedFlight | None:
    """Figures of a flight; None where the learned map suits none of its frames."""
    capture = load(flight)
    made = single_frames(capture)
    assert capture.poses is not None
    full = capture.poses.time_s - capture.poses.time_s[0] >= FULL_S
    full &= [whole is not None for _, whole in made]
    frames, taken_s = {SINGLE: list(judged(capture, alone(made), made))}, []
    for kind in kinds:
        stated = with_error(capture, POSE_ERRORS[kind], flight.seed)
        maps, ended_s = [], [time.process_time()]
        for each in remembered(stated, made):
            maps.append(each)
            ended_s.append(time.process_time())
        taken_s.append(np.diff(ended_s)[full].mean() if full.any() else np.nan)
        frames[kind] = list(judged(capture, maps, made))
    return JudgedFlight(flight, frames, min(taken_s)) if frames[SINGLE] else None


def maps_of(
    flight: Flight, kind: str
) -> tuple[Capture, list[Remembered | None], list[FrameMap | None]]:
    """A flight, its maps with the memory by a kind of pose error, and those of its frames alone."""
    capture = load(flight)
    stated, made = with_error(capture, POSE_ERRORS[kind], flight.seed), single_frames(capture)
    return capture, list(remembered(stated, made)), [whole for _, whole in made]


Made = list[tuple[View, FrameMap | None]]


def single_frames(capture: Capture) -> Made:
    """The single frames' maps, reconstructed in order."""
    watched = _Watched()
    reconstruct = Reconstructor(capture.setup, depth=watched)
    for number in range(capture.frames):
        reconstruct(capture.batch(number, number + 1))
    return watched.made


def alone(made: Made) -> list[Remembered | None]:
    """Maps of the single frames, as if with a memory of nothing."""
    none = np.zeros((0, 3))
    return [whole and Remembered(whole.estimate, none, np.zeros(0), None) for _, whole in made]


def remembered(
    capture: Capture, made: Made, clock: type[ClockOffset] = ClockOffset
) -> Iterator[Remembered | None]:
    """Maps with the memory, which takes the poses' clock for what `clock` says."""
    assert capture.optics is not None
    memory = FlightMemory(capture.optics, capture.plan.shape)
    memory.clock = clock(capture.optics, capture.plan.shape)
    for number, (view, whole) in enumerate(made):
        pose = pose_at(capture.poses, number)
        assert pose is not None
        yield whole and memory.take(pose, view.image, whole.estimate, ranges_of(view, whole))


def judged(capture: Capture, maps: Sequence[Remembered | None], made: Made) -> Iterator[Judged]:
    """Maps against the truth of the frames that have one."""
    truth, poses, optics = capture.truth, capture.poses, capture.optics
    assert truth is not None
    assert poses is not None
    assert optics is not None
    rays = pixel_rays(optics, capture.plan.shape)
    corridor = Corridor(rays)
    for number in truth.frame.tolist():
        with_memory, whole, true = maps[number], made[number][1], truth.at(number)
        if with_memory is None or whole is None or with_memory.estimate.sigma is None:
            continue
        estimate = with_memory.estimate
        there = np.isfinite(true.depth_m) & (true.depth_m < MAX_RANGE_M)
        if not there.any() or not np.isfinite(estimate.depth_m).all():
            continue
        off = (np.log(estimate.depth_m) - np.log(np.where(there, true.depth_m, 1)))[there]
        deviations = off / estimate.sigma[there]
        ahead = Ahead.of(estimate, rays, prior_of(whole))
        yield Judged(
            float(poses.time_s[number] - poses.time_s[0]),
            float(np.mean(np.abs(np.expm1(off)))),
            float(np.mean(np.abs(deviations) < 2)),
            corridor.nearest_m(true.depth_m.astype(np.float64)),
            float(true.corridor_m),
            ahead.free(),
            deviations[::16].astype(np.float32),
        )
