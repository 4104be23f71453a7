"""What benchmarks/depth.py measures on one capture: every depth method, on two kinds of ranges."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from depth_sets import Case

from reconstruction import Capture, Reconstructor, Setup, read_capture
from reconstruction.base.arrays import Floats
from reconstruction.chosen_methods import USUAL_IMAGES
from reconstruction.depth import (
    DEPTH_METHODS,
    DISTANCES_M,
    Context,
    Corridor,
    DepthEstimate,
    DepthMethod,
    DepthSolver,
    View,
    corridors_of,
    free_of_estimate,
    lacks,
    pixel_rays,
)
from reconstruction.depth.kriging import AnchoredPrior
from reconstruction.depth.methods.anchored import Anchored
from reconstruction.evaluation import depth_metrics
from reconstruction.image import Imaging

RANGINGS = ("cw", "fog")
FROZEN = "anchored, frozen"
CONSTANTS = AnchoredPrior(
    log_depth_sigma=0.4,
    log_reflectance_sigma=0.7,
    correlation_length=0.5,
    similarity=0.7,
    nugget=0.05,
    min_brightness=0.2,
    uncertain=0.05,
    max_nearer=1.3,
    sigma_factor=1.0,
)
"""Of the anchored map that others are compared with."""

Way = tuple[str, str]
"""Depth method and ranging."""


@dataclass(frozen=True)
class Judged:
    """All figures of one capture."""

    case: Case
    figures: Mapping[Way, Mapping[str, float | None]]
    free: Mapping[Way, Floats]
    """Probability that the corridor is free up to each of `DISTANCES_M`."""
    obstacle_m: float
    """The true nearest one, nan without any."""

    @property
    def scene_name(self) -> str:
        """Captures of one are alike; scenes are drawn independently."""
        return f"{self.case.group} {self.case.scene}"


class Compiled:
    """What makes image, ranges, and depths by all methods that a setup suits."""

    def __init__(self, setup: Setup) -> None:
        context = Context(setup, Imaging(setup.plan))
        self._reconstructor = Reconstructor(setup, ranging=RANGINGS, depth=())
        self._solvers: dict[str, DepthSolver] = {
            name: method.compile(context) for name, method in methods(setup).items()
        }

    def __call__(self, capture: Capture) -> Iterator[tuple[Way, DepthSolver, View]]:
        """Every method on every kind of ranges."""
        frame = capture.frame(0)
        result = self._reconstructor(frame)
        image = result.image.astype(np.float64)
        for ranging, ranges in result.rangings.items():
            for method, solve in self._solvers.items():
                yield (method, ranging), solve, View(image, ranges, frame)


def methods(setup: Setup) -> dict[str, DepthMethod]:
    """By name: the one that is frozen, and those that are registered and fit."""
    result: dict[str, DepthMethod] = {FROZEN: Anchored(CONSTANTS)}
    fit = (name for name in DEPTH_METHODS if not lacks(DEPTH_METHODS[name], setup))
    return result | {name: DEPTH_METHODS[name] for name in fit}


COMPILED: dict[str, Compiled] = {}
"""By preset, of which all captures have the same setup."""


def judge(case: Case) -> Judged:
    """Metrics of every method on both kinds of ranges."""
    capture = read_capture(case.path)
    assert capture.truth is not None
    assert capture.setup.optics is not None
    true_m = capture.truth.at(0).depth_m
    rays = pixel_rays(capture.setup.optics, true_m.shape)
    if case.preset not in COMPILED:
        COMPILED[case.preset] = Compiled(capture.setup)
    corridor = Corridor(rays)
    figures, stated = {}, {}
    for way, solve, view in COMPILED[case.preset](capture):
        result = solve(view) or DepthEstimate(np.full(true_m.shape, np.nan))
        free = (
            None if way[0] == FROZEN else free_of_estimate(result, corridors_of(result, rays))
        )  # its obstacle is the map's
        figures[way] = depth_metrics(
            result.depth_m,
            true_m,
            sigma=result.sigma,
            no_return=result.no_return,
            rays=rays,
            free=free,
        )
        stated[way] = np.zeros(DISTANCES_M.size) if free is None else free
    return Judged(case, figures, stated, corridor.nearest_m(true_m))


def seconds(case: Case, way: Way, frames: int) -> float:
    """Processor time of a frame by one way alone, from counts to depth: median of so many."""
    capture = read_capture(case.path)
    method, ranging = way
    reconstructor = Reconstructor(
        capture.setup, image=USUAL_IMAGES[0], ranging=ranging, depth=method
    )
    frame, taken = capture.frame(0), []
    for _ in range(frames + 1):
        start = time.process_time()
        reconstructor(frame)
        taken.append(time.process_time() - start)
    return float(np.median(taken[1:]))
