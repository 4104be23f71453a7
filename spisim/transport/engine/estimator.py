"""Two-ended light transport: one image and one set of path-length histograms for all patterns.

Paths from the projector and paths from the detector estimate the same light. Each strategy alone
is unbiased, and noisy where a path scatters close to the opposite end; weighted against each
other, and against a third that joins a detector's path to a ray of the projector, they cover each
other's weakness (`spisim.transport.engine.walk`). Light that is scattered once only needs no walk: it is
summed along the projector's rays (`spisim.transport.engine.direct`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.errors import InputError
from spisim.transport.engine.beams import Beams
from spisim.transport.engine.direct import direct_light
from spisim.transport.engine.ends import Detectors, JointDetectors, Projector
from spisim.transport.engine.points import Points
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.sampling import Effort, Estimate, repeat
from spisim.transport.engine.tally import (
    HistogramTally,
    ImageTally,
    OrderTally,
    PathLengthBins,
    PhasorTally,
    Tally,
)
from spisim.transport.engine.walk import Contribution, Deposit, Rays, Sky, Weight, walk
from spisim.transport.views import BeamView, DetectorView, Floats, ProjectorView
from spisim.transport.world import World

#: Paths longer than this carry nothing worth following; roulette ends almost all of them earlier.
MAX_VERTICES = 256
#: Single precision tells path lengths of 100 m to 0.1 mm: 1/300 of a period.
HIGHEST_FREQUENCY_HZ = 1e10


class Strategy(Enum):
    """Which ends launch paths. `BOTH` is the estimator to use, the others are checks on it."""

    BOTH = "two-ended"
    PROJECTOR = "projector"
    DETECTOR = "detector"


@dataclass(frozen=True)
class Wanted:
    """What to keep of the light of the image besides the transport image itself.

    Raises InputError for a frequency that single precision of the path length cannot resolve.
    """

    orders: bool = False  # unscattered, single and multiple apart, of all that is kept
    frequencies_hz: tuple[float, ...] = ()  # phasor images
    bins: PathLengthBins | None = None  # transport cube

    def __post_init__(self) -> None:
        for frequency_hz in self.frequencies_hz:
            if not 0 <= frequency_hz <= HIGHEST_FREQUENCY_HZ:
                raise InputError(
                    f"frequency {frequency_hz:g} Hz: path lengths are known to 0.1 mm, which "
                    f"resolves the phase of 0 to {HIGHEST_FREQUENCY_HZ:g} Hz"
                )

    def tallies(self, cells: int) -> list[Tally]:
        """Empty sums for one launch."""
        kinds: list[Callable[[int], Tally]] = [ImageTally]
        if self.frequencies_hz:
            kinds.append(partial(PhasorTally, frequencies_hz=self.frequencies_hz))
        if self.bins is not None:
            kinds.append(partial(HistogramTally, bins=self.bins))
        if self.orders:
            return [OrderTally(cells, kind) for kind in kinds]
        return [kind(cells) for kind in kinds]


def transport_image(
    world: World,
    projector: ProjectorView,
    detector: DetectorView,
    effort: Effort,
    *,
    seed: np.random.SeedSequence,
    wanted: Wanted = Wanted(),
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Fraction of each virtual pixel's power that reaches the detectors: `image` (H·W,).

    Several detectors are alike, and their light is added up.
    `effort` counts paths per virtual pixel from each end that takes part. What else is `wanted`
    comes under the names of `spisim.transport.engine.tally`.
    """
    pixels = projector.pixels

    def launch(samples: int, seeds: Sequence[int]) -> Mapping[str, Floats]:
        tallies = wanted.tallies(pixels)
        deposit = _into(tallies)
        near = Projector.of(projector, samples)
        far = JointDetectors.of(detector, -(-samples * pixels // len(detector.positions_m)))
        # In clear air there is no fog to connect to.
        bridged = strategy is Strategy.BOTH and bool(world.media.parts)
        rays = FogRays(world, near) if bridged else None
        outward = inward = alone
        if strategy is Strategy.BOTH:
            outward, inward = _second_on_or_behind_glass, _second_on
            direct_light(world, near, far, *points(near.lanes, pixels, seeds[2]), deposit)
            if max_vertices == 1:
                return _read(tallies, detector.area_m2)
        if strategy is not Strategy.DETECTOR:
            run(world, near, far, seeds[0], max_vertices, _OUT, outward, deposit, rays=rays)
        if strategy is not Strategy.PROJECTOR:
            run(world, far, near, seeds[1], max_vertices, _BACK, inward, deposit, rays=rays)
        return _read(tallies, detector.area_m2)

    return repeat(launch, effort, pixels, seed, progress)


def spot_histogram(
    world: World,
    beams: BeamView,
    detectors: DetectorView,
    bins: PathLengthBins,
    effort: Effort,
    *,
    seed: np.random.SeedSequence,
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Fraction of each laser's power on its detector: `histogram` (beams, bins).

    `histogram_orders` (3, beams, bins) has it split by scattering. `effort` counts paths per beam
    from each end.
    """
    count = len(beams.origins_m)

    def launch(samples: int, seeds: Sequence[int]) -> Mapping[str, Floats]:
        tallies = [OrderTally(count, partial(HistogramTally, bins=bins))]
        deposit = _into(tallies)
        near = Beams.of(world, beams, samples)
        far = Detectors.of(detectors, samples)
        direct_light(world, near, far, *points(near.lanes, count, seeds[2]), deposit)
        if max_vertices > 1:
            weight = _balanced if strategy is Strategy.BOTH else alone
            if strategy is not Strategy.DETECTOR:
                run(world, near, far, seeds[0], max_vertices - 1, _OUT, weight, deposit)
            if strategy is not Strategy.PROJECTOR:
                run(world, far, near, seeds[1], max_vertices - 1, _BACK, weight, deposit)
        return _read(tallies, detectors.area_m2)

    return repeat(launch, effort, count, seed, progress)


def run(
    world: World,
    this: Any,
    other: Any,
    seed: int,
    max_vertices: int,
    mode: str,
    weight: Weight,
    deposit: Deposit,
    sky: Sky | None = None,
    rays: Rays | None = None,
) -> None:
    """Walk one path per lane of `this` end, connecting to the `other`."""
    lane, sampler = lanes(this.lanes, seed)
    limit = dr.opaque(mi.UInt32, max_vertices)
    transport_mode = getattr(mi.TransportMode, mode)
    walk(
        world.geometry,
        world.media,
        this,
        other,
        rays,
        lane,
        sampler,
        limit,
        transport_mode,
        weight,
        deposit,
        sky,
    )


#: Mitsuba's transport modes, for paths that start at an emitter and at a sensor.
_OUT, _BACK = "Importance", "Radiance"


def lanes(count: int, seed: int) -> tuple[Any, Any]:
    """Lane numbers and a sampler for them."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(dr.opaque(mi.UInt32, seed), count)
    return dr.arange(mi.UInt32, count), sampler


def points(count: int, cells: int, seed: int) -> tuple[Any, Any]:
    """Lane numbers, cell by cell in turn, and a low-discrepancy sequence for every cell."""
    lane = dr.arange(mi.UInt32, count)
    return lane, Points.of(lane // cells, lane % cells, dr.opaque(mi.UInt32, seed))


def alone(others: Any, vertex: Any, crossed: Any) -> Any:
    """Weight of a strategy that is the only one."""
    return mi.Float(1)


def _balanced(others: Any, vertex: Any, crossed: Any) -> Any:
    """Balance heuristic."""
    return dr.rcp(1 + others)


def _second_on(others: Any, vertex: Any, crossed: Any) -> Any:
    """Balance heuristic for light scattered twice or more; the rest is found elsewhere."""
    return dr.select(vertex == 1, 0, dr.rcp(1 + others))


def _second_on_or_behind_glass(others: Any, vertex: Any, crossed: Any) -> Any:
    """The same, and all light scattered once behind a surface that it went straight through.

    The sum along the projector's rays ends at the first surface.
    """
    return dr.select(vertex == 1, dr.select(crossed, 1, 0), dr.rcp(1 + others))


def _into(tallies: Sequence[Tally]) -> Deposit:
    def deposit(light: Contribution) -> None:
        for tally in tallies:
            tally.add(light)

    return deposit


def _read(tallies: Sequence[Tally], area_m2: float) -> dict[str, Floats]:
    return {name: values * area_m2 for tally in tallies for name, values in tally.read().items()}
