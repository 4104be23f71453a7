"""What benchmarks/depth.py measures on one capture: every depth method, on two kinds of ranges."""

import time
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from depth_sets import Case

from reconstruction import Reconstructor, Setup, read_capture
from reconstruction.base.arrays import Floats
from reconstruction.chosen_methods import USUAL_IMAGES
from reconstruction.depth import (
    DEPTH_METHODS,
    DISTANCES_M,
    Corridor,
    lacks,
    pixel_rays,
)
from reconstruction.depth.kriging import AnchoredPrior
from reconstruction.depth.methods.anchored import Anchored
from reconstruction.evaluation import depth_metrics

RANGINGS = ("cw", "fog")
FROZEN = "anchored-frozen"
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


@dataclass(frozen=True)
class Frozen(Anchored):
    """The anchored map of constants that never change."""

    name: str = FROZEN
    prior: AnchoredPrior = CONSTANTS


def compiled(setup: Setup) -> dict[Way, Reconstructor]:
    """Every depth method that a setup suits, and the frozen one, on both kinds of ranges."""
    fit = [name for name in DEPTH_METHODS if not lacks(DEPTH_METHODS[name], setup)]
    return {
        (method if isinstance(method, str) else FROZEN, ranging): Reconstructor(
            setup, image=USUAL_IMAGES[0], ranging=ranging, depth=method
        )
        for method in (Frozen(), *fit)
        for ranging in RANGINGS
    }


COMPILED: dict[str, dict[Way, Reconstructor]] = {}
"""By preset, of which all captures have the same setup."""


def judge(case: Case) -> Judged:
    """Metrics of every method on both kinds of ranges."""
    capture = read_capture(case.path)
    assert capture.truth is not None
    assert capture.setup.optics is not None
    true_m = capture.truth.at(0).depth_m
    rays = pixel_rays(capture.setup.optics, true_m.shape)
    if case.preset not in COMPILED:
        COMPILED[case.preset] = compiled(capture.setup)
    corridor = Corridor(rays)
    figures, stated = {}, {}
    unknown = np.full(true_m.shape, np.nan)
    for way, reconstructor in COMPILED[case.preset].items():
        result = reconstructor(capture.frame(0))
        free = None if way[0] == FROZEN else result.free_probability
        figures[way] = depth_metrics(
            unknown if result.depth_m is None else result.depth_m,
            true_m,
            sigma=result.log_depth_sigma,
            no_return=result.no_return,
            rays=rays,
            free=free,  # the obstacle of the frozen map is the map's
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
