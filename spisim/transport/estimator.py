"""Two-ended light transport: one image and one set of path-length histograms for all patterns.

Paths from the projector and paths from the detector estimate the same light. Each strategy alone
is unbiased, and noisy where a path scatters close to the opposite end; weighted against each
other by the balance heuristic they cover each other's weakness. Light that reaches a surface
straight from the projector and the detector straight from there is left to the projector's
paths, which sample it almost without noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from spisim.transport.accumulator import Accumulator
from spisim.transport.beams import Beams, direct_light
from spisim.transport.ends import Detectors, Projector
from spisim.transport.views import BeamView, DetectorView, Floats, ProjectorView
from spisim.transport.walk import walk
from spisim.transport.world import World

#: Paths longer than this carry nothing worth following; roulette ends almost all of them earlier.
MAX_VERTICES = 256
#: Independent repetitions of a solution, from which its standard error is taken.
REPLICATES = 8
#: Lanes of one kernel launch, per strategy: bounds memory.
MAX_LANES = 2**20


class Strategy(Enum):
    """Which ends launch paths. `BOTH` is the estimator to use, the others are checks on it."""

    BOTH = "two-ended"
    PROJECTOR = "projector"
    DETECTOR = "detector"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Mean over the replicates and its standard error, fractions of emitted power."""

    mean: Floats
    error: Floats
    paths: int


def transport_image(
    world: World,
    projector: ProjectorView,
    detector: DetectorView,
    *,
    spp: int,
    seed: np.random.SeedSequence,
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Fraction of each virtual pixel's power that reaches the detector, (H, W).

    `spp` paths per virtual pixel are launched from each end that takes part.
    """
    pixels = projector.pixels
    chunks = _Chunks(spp, pixels)

    def chunk(samples: int, seeds: tuple[int, int]) -> Floats:
        accumulator = Accumulator(pixels)
        near = Projector.of(projector, samples)
        far = Detectors.of(detector, samples * pixels)

        def deposit(value: Any, cell: Any, length: Any, vertex: Any, active: Any) -> None:
            accumulator.add(value, cell, active)

        if strategy is not Strategy.DETECTOR:
            weight = _balance(direct=1) if strategy is Strategy.BOTH else _alone
            _run(world, near, far, seeds[0], max_vertices, weight, deposit)
        if strategy is not Strategy.PROJECTOR:
            weight = _balance(direct=0) if strategy is Strategy.BOTH else _alone
            _run(world, far, near, seeds[1], max_vertices, weight, deposit)
        return accumulator.read().reshape(projector.shape) * detector.area_m2

    return chunks.run(chunk, seed, progress)


def spot_histogram(
    world: World,
    beams: BeamView,
    detectors: DetectorView,
    *,
    bins: int,
    bin_width_m: float,
    samples: int,
    seed: np.random.SeedSequence,
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Fraction of each laser's power that reaches its detector, per optical path length.

    Returns (beams, bins); bin k is centred on path length k x `bin_width_m`. A contribution is
    shared between its two neighbouring bins so that its path length is kept exactly; what is
    longer than the last bin is counted there. `samples` paths per beam from each end.
    """
    count = len(beams.origins_m)
    chunks = _Chunks(samples, count)

    def chunk(samples: int, seeds: tuple[int, int]) -> Floats:
        accumulator = Accumulator(count * bins)
        near = Beams.of(world.geometry, world.fog, beams, samples)
        far = Detectors.of(detectors, samples)

        def deposit(value: Any, cell: Any, length: Any, vertex: Any, active: Any) -> None:
            place = dr.minimum(length / bin_width_m, bins - 1)
            low = dr.minimum(mi.UInt32(place), bins - 2)
            upper = place - mi.Float(low)
            accumulator.add(value * (1 - upper), cell * bins + low, active)
            accumulator.add(value * upper, cell * bins + low + 1, active)

        lane, sampler = _lanes(near.lanes, seeds[0])
        direct_light(near, far, lane, sampler, deposit)
        if max_vertices > 1:
            weight = _balance() if strategy is Strategy.BOTH else _alone
            if strategy is not Strategy.DETECTOR:
                _run(world, near, far, seeds[0] + 1, max_vertices - 1, weight, deposit)
            if strategy is not Strategy.PROJECTOR:
                _run(world, far, near, seeds[1], max_vertices - 1, weight, deposit)
        return accumulator.read().reshape(count, bins) * detectors.area_m2

    return chunks.run(chunk, seed, progress)


def _run(
    world: World,
    this: Any,
    other: Any,
    seed: int,
    max_vertices: int,
    weight: Callable[[Any, Any, Any], Any],
    deposit: Callable[[Any, Any, Any, Any, Any], None],
) -> None:
    lane, sampler = _lanes(this.lanes, seed)
    limit = dr.opaque(mi.UInt32, max_vertices)
    walk(world.geometry, world.fog, this, other, lane, sampler, limit, weight, deposit)


def _lanes(count: int, seed: int) -> tuple[Any, Any]:
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, seed), count)
    return dr.arange(mi.UInt32, count), sampler


def _alone(ratio: Any, vertex: Any, on_surface: Any) -> Any:
    return mi.Float(1)


def _balance(direct: float | None = None) -> Callable[[Any, Any, Any], Any]:
    """Balance heuristic; `direct`, if given, is the weight of unscattered light off a surface."""

    def weight(ratio: Any, vertex: Any, on_surface: Any) -> Any:
        balanced = dr.rcp(1 + ratio)
        if direct is None:
            return balanced
        return dr.select((vertex == 1) & on_surface, direct, balanced)

    return weight


class _Chunks:
    """Splits samples into equal replicates, and replicates into launches of bounded size."""

    def __init__(self, samples: int, cells: int) -> None:
        self.per_launch = max(1, min(samples // REPLICATES, MAX_LANES // cells))
        self.launches = max(1, round(samples / REPLICATES / self.per_launch))
        self.paths = 2 * REPLICATES * self.launches * self.per_launch * cells

    def run(
        self,
        chunk: Callable[[int, tuple[int, int]], Floats],
        seed: np.random.SeedSequence,
        progress: Callable[[float], None] | None,
    ) -> Estimate:
        total = squares = np.zeros(())
        for replicate in range(REPLICATES):
            mean = np.zeros(())
            for launch in range(self.launches):
                step = replicate * self.launches + launch
                mean = mean + chunk(self.per_launch, _seeds(seed, step)) / self.launches
                if progress is not None:
                    progress((step + 1) / (REPLICATES * self.launches))
            total, squares = total + mean, squares + mean**2
        mean = total / REPLICATES
        variance = np.maximum(squares / REPLICATES - mean**2, 0) / (REPLICATES - 1)
        return Estimate(mean, np.sqrt(variance), self.paths)


def _seeds(seed: np.random.SeedSequence, step: int) -> tuple[int, int]:
    child = np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, step))
    first, second = child.generate_state(2)
    return int(first), int(second)
