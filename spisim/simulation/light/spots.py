"""Light of lasers or zones on their detectors, by path length."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView
from spisim.simulation.light.noise_metric import spot_error_metric
from spisim.simulation.light.path_bins import bins_for
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.path_weights import PathWeight
from spisim.transport.engine.sampling import (
    ErrorMetric,
    Estimate,
    PathBudget,
    SamplingBudget,
    TargetError,
)
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.engine.walk import MAX_VERTICES
from spisim.transport.world import World

#: Laser paths per `spp`: the few beams need far fewer paths than thousands of pixels.
SPOT_PATHS_PER_SPP = 64
#: Laser paths of the first launch towards a target error: fewer would take as long.
FIRST_SPOT_PATHS = 64
#: Maximum growth of the number of paths from launch to launch: early error estimates are good.
GROWTH = 3.0
#: `spp`, and the target noise share that replaces it.
SampleBudget = tuple[int, float | None]


def trace_spots(
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    steady: Mapping[str, Any],
    sampling: SampleBudget,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
) -> tuple[Estimate, Floats]:
    """Light of the lasers on their detectors, and the path lengths (bins,) of its histogram."""
    bins = bins_of(instrument, world, placed)
    metric = spot_metric(instrument, steady, bins)
    return spots_of(world, placed, bins, metric, sampling, seed, progress), bins.centres_m


def bins_of(instrument: Instrument, world: World, placed: InstrumentView) -> PathLengthBins:
    """Bins of the spots' histograms."""
    return bins_for(instrument.ranging.tof, world.axis_distances_m(placed.beams))


def spot_metric(
    instrument: Instrument, steady: Mapping[str, Any], bins: PathLengthBins
) -> ErrorMetric:
    """Errors of the spots' phasors beside this steady light."""
    longest_m = 2 * instrument.ranging.tof.unambiguous_range_m
    return spot_error_metric(
        instrument,
        steady["spot_daylight_w"],
        steady["spot_crosstalk_w"],
        2 * np.pi / longest_m * bins.centres_m,
    )


def spots_of(
    world: World,
    placed: InstrumentView,
    bins: PathLengthBins,
    error_metric: ErrorMetric,
    sampling: SampleBudget,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
    path_weights: Sequence[PathWeight] = (),
) -> Estimate:
    """Light of the lasers on their detectors."""
    spp, noise_share = sampling
    budget: SamplingBudget = PathBudget(SPOT_PATHS_PER_SPP * spp, error_metric=error_metric)
    if noise_share is not None:
        budget = TargetError(noise_share, error_metric, FIRST_SPOT_PATHS, growth=GROWTH)
    return ranging_histogram(
        world, placed, bins, budget, seed=seed, path_weights=path_weights, progress=progress
    )


def ranging_histogram(
    world: World,
    placed: InstrumentView,
    bins: PathLengthBins,
    budget: SamplingBudget,
    *,
    seed: np.random.SeedSequence,
    max_vertices: int = MAX_VERTICES,
    path_weights: Sequence[PathWeight] = (),
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Light of spots or zones by path length; see `spot_histogram`.

    Light is the same both ways: zones are traced as pixels whose light the flood collects.
    """
    options: Any = {"seed": seed, "max_vertices": max_vertices, "progress": progress}
    if placed.zones is None:
        options["path_weights"] = path_weights
        return spot_histogram(world, placed.beams, placed.tof, bins, budget, **options)
    flood = replace(placed.tof, positions_m=placed.tof.positions_m[:1], axes=placed.tof.axes[:1])
    outputs = Outputs(orders=True, bins=bins, weights=tuple(path_weights))
    return transport_image(world, placed.zones, flood, budget, outputs=outputs, **options)
