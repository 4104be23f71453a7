"""What an instrument measures in lit cases: errors of its ranges and images, and their bounds."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from warnings import catch_warnings, simplefilter

import numpy as np

from reconstruction import Capture, Reconstructor
from reconstruction.base.arrays import Floats, Mask
from reconstruction.base.errors import InputError
from reconstruction.capture.schema import between
from reconstruction.default_ranging import SetupKey, default_ranges
from reconstruction.evaluation.metrics import image_metrics
from reconstruction.ranging.bound import Targets, make_bound, smooth_overlap
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.measurement import record, spot_light
from spisim_inverse.design.light import Lit

RANGES, BOUNDS, IMAGES = "ranges", "bounds", "images"
"""What can be sampled."""


@dataclass(frozen=True, eq=False)
class Sample:
    """What was measured in one case.

    ``counts`` (spots,) are the spots with a target within the maximum range; ``error_m`` (draws,
    spots) is nan for no range; ``bound_m`` (spots,) and ``image_nrmse`` (draws,) are empty unless
    they were asked for.
    """

    world: str
    weather: str
    counts: Mask
    error_m: Floats
    bound_m: Floats
    image_nrmse: Floats


def sample(
    instrument: Instrument,
    lit: Sequence[Lit],
    wanted: Collection[str],
    *,
    max_range_m: float,
    draws: int,
    seed: int,
    progress: Callable[[float], None] = lambda fraction: None,
) -> list[Sample]:
    """Sample all cases; equal seeds give equal noise to all instruments.

    Parameters
    ----------
    instrument
        The instrument, whose optics made the light.
    lit
        The cases.
    wanted
        Of `RANGES`, `BOUNDS` and `IMAGES`.
    max_range_m
        Farther spots do not count.
    draws
        Frames of each case.
    seed
        Of the noise.
    progress
        Called with the finished fraction.

    Raises
    ------
    InputError
        If the readings have no bound, or the fog is uneven and bounds are wanted.
    """
    uneven = [each.case.scene.name for each in lit if each.case.scene.volumes]
    if uneven and BOUNDS in wanted:
        raise InputError(
            f"range_bound_m: {uneven[0]} has volumes, and the bound is that of even fog; use "
            "range_error_m"
        )
    samples = []
    for number, each in enumerate(lit):
        samples.append(_sampled(instrument, each, wanted, max_range_m, draws, seed + number))
        progress((number + 1) / len(lit))
    return samples


def has_bounds(instrument: Instrument, scenes: Iterable[Scene]) -> bool:
    """Whether ranges have bounds: readings that the fit in fog supports, in even air."""
    if not instrument.ranges or any(scene.volumes for scene in scenes):
        return False
    return instrument.ranging.tof.method in ("cw", "pulsed")


def _sampled(
    instrument: Instrument,
    lit: Lit,
    wanted: Collection[str],
    max_range_m: float,
    draws: int,
    seed: int,
) -> Sample:
    scene, truth = lit.case.scene, lit.truth
    counts = np.asarray(truth.spot_range_m <= max_range_m)  # not those without a target
    none = np.zeros(0)
    error_m, bound_m, image_nrmse = none, none, none
    with catch_warnings():
        simplefilter("ignore")  # of single instruments among many
        capture = record(scene, instrument, lit.light, (truth,), seed=seed, frames=draws)
        if RANGES in wanted:
            error_m = _range_errors_m(capture)
        if IMAGES in wanted:
            image_nrmse = _image_errors(capture)
        if BOUNDS in wanted and counts.any():
            bound_m = _bounds_m(instrument, lit, capture, max_range_m)
    return Sample(lit.case.world, lit.case.weather, counts, error_m, bound_m, image_nrmse)


def _range_errors_m(capture: Capture) -> Floats:
    assert capture.truth is not None
    rows = []
    for frame in range(capture.frames):
        ranges, true_m = default_ranges(capture, frame), capture.truth.at(frame).spot_range_m
        rows.append(np.full(len(true_m), np.nan) if ranges is None else ranges.range_m - true_m)
    return np.array(rows)


def _image_errors(capture: Capture) -> Floats:
    assert capture.truth is not None
    reconstruct = _imaging(SetupKey(capture.setup))
    errors = [
        image_metrics(reconstruct(capture.frame(frame)).image, capture.truth.at(frame).image)
        for frame in range(capture.frames)
    ]
    return np.array([np.nan if each["nrmse"] is None else each["nrmse"] for each in errors])


@lru_cache(maxsize=2)
def _imaging(key: SetupKey) -> Reconstructor:
    return Reconstructor(key.setup, ranging=(), depth=())


def _bounds_m(instrument: Instrument, lit: Lit, capture: Capture, max_range_m: float) -> Floats:
    """Cramér–Rao bounds (spots,); infinite for spots that do not count.

    The reflectance is what unscattered light says of it.
    """
    air = lit.case.scene.atmosphere
    tof, optics = instrument.ranging.tof, instrument.spot_optics
    light = spot_light(instrument, lit.light, 1)
    readings = tof.record(light, optics, None).readings[0]
    spots = capture.spots
    assert spots is not None
    counts = np.asarray(lit.truth.spot_range_m <= max_range_m)
    range_m = np.where(counts, lit.truth.spot_range_m, max_range_m)
    weight, path_m = smooth_overlap(optics, range_m)
    own = np.arange(len(range_m))
    through = weight[own, own] * np.exp(-air.extinction_per_m * path_m[own, own])
    direct = lit.light.transports[0].extra["spot_orders"][0].sum(axis=-1)
    targets = Targets(
        range_m,
        np.pi * direct / np.maximum(through, np.finfo(float).tiny),
        air.extinction_per_m,
        air.scattering_per_m * air.backscatter_per_sr,
    )
    bound = make_bound(between(spots, 0, 0), max_range_m)
    return np.where(counts, bound(targets, readings), np.inf)
