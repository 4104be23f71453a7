"""All the light that an instrument receives from a scene."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.instrument import Detector, Instrument
from spisim.instrument.model import Source
from spisim.scene import Scene
from spisim.simulation.light.extra import extra_light, steady_weighted, weighted_light
from spisim.simulation.light.noise_metric import image_error_metric, spot_error_metric
from spisim.simulation.light.path_bins import BIN_WIDTH_M, spot_bins
from spisim.simulation.light.stated_error import image_error, spot_error
from spisim.transport.backend import with_backend
from spisim.transport.daylight import STEADY_ERROR, Received, daylight_power, projector_power
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.path_weights import PathWeight, tracked_by
from spisim.transport.engine.sampling import Estimate, PathBudget, SamplingBudget, TargetError
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.engine.walk import MAX_VERTICES
from spisim.transport.glints import warn_of_glints
from spisim.transport.views import InstrumentView
from spisim.transport.world import World, build_world

logger = logging.getLogger(__name__)

#: Laser paths per `spp`: the few beams need far fewer paths than thousands of pixels.
SPOT_PATHS_PER_SPP = 64
#: Laser paths of the first launch towards a target error: fewer would take as long.
FIRST_SPOT_PATHS = 64
#: Minimum launches of the image towards a target error: enough, as many coefficients average it.
MIN_IMAGES = 5
#: Minimum paths per pixel and launch: each path has several rays, which gather most of the light.
MIN_PATHS = 0.5
#: Maximum growth of the number of paths from launch to launch: early error estimates are good.
GROWTH = 3.0


@dataclass(frozen=True, eq=False)
class Transport:
    """Light transport of one scene and instrument: fractions of emitted power, and daylight.

    Without lasers the arrays of spots have length 0; without a projector `image` is one dark pixel.

    `*_error` are standard errors of the Monte Carlo estimate; those of pixels and bins are smoothed
    over their neighbours (see `stated_error`). `extra` has what `Outputs` asked for:
    `phasors` (F, H, W), complex; `cube` (H, W, bins) and `cube_path_length_m` (bins,); and, split
    into unscattered, single and multiple, `orders` (3, H, W) of the image, `phasor_orders`
    (3, F, H, W), `cube_orders` (3, H, W, bins) and `spot_orders` (3, spots, bins).
    """

    image: Floats  # (H, W): fraction of a virtual pixel's power on the bucket detector's apertures
    image_error: Floats
    #: (spots, bins): fraction of a laser's, or the flood's, power on its detector's aperture.
    spot_histogram: Floats
    spot_histogram_error: Floats
    #: (bins,): whole optical path, emitter to detector; see `spisim.simulation.light.path_bins`.
    path_length_m: Floats
    daylight_w: float  # in-band power of sun and sky on the bucket detectors' apertures
    daylight_error_w: float
    spot_daylight_w: Floats  # (spots,)
    spot_daylight_error_w: Floats
    spot_crosstalk_w: Floats  # (spots,): mean power of the projector's patterns there
    spot_crosstalk_error_w: Floats
    #: Standard errors over the detectors' noise, rms: of decoded coefficients, of spots' phasors.
    noise_share: float
    spot_noise_share: float
    dropped: int  # contributions that were not finite numbers, and are left out
    paths: int
    seconds: float
    extra: Mapping[str, NDArray[Any]]  # as above


#: `spp`, and the target noise share that replaces it.
SampleBudget = tuple[int, float | None]


def _none(**sums: Floats) -> Estimate:
    """Estimate of no light."""
    return Estimate(sums, sums, launches=2, paths=0, size=float("nan"), dropped=0)


#: Light without a projector, and without lasers.
NO_IMAGE = _none(image=np.zeros(1))
NO_SPOTS = _none(histogram=np.zeros((0, 0)), histogram_orders=np.zeros((3, 0, 0)))


@with_backend
def solve(
    scene: Scene,
    instrument: Instrument,
    *,
    spp: int = 256,
    transport_noise_share: float | None = None,
    seed: int = 0,
    outputs: Outputs = Outputs(),  # noqa: B008
    progress: Callable[[float], None] | None = None,
) -> Transport:
    """Trace the light of projector, lasers and sky through the scene, once for all patterns.

    Parameters
    ----------
    scene, instrument
        As of `spisim.load_scene` and `spisim.load_instrument`.
    spp
        Paths per virtual pixel from either end.
    transport_noise_share
        Instead of `spp`: trace until the rms standard errors of the decoded coefficients, and of
        the spots' phasors, are at most this fraction of the detectors' noise.
    seed
        The same seed gives the same bits on the same machine and backend.
    outputs
        What to record besides the transport image.
    progress
        Called with the completed fraction.

    Raises
    ------
    InputError
        If the scene was made for another wavelength than the instrument's, the histograms are too
        coarse for what is modulated onto the light, or more light returns than can be summed.

    Warns
    -----
    TransportWarning
        If some light was not a finite number and is left out, or a mirror throws a laser straight
        into its detector.
    """
    began = time.perf_counter()
    if instrument.ranges:
        instrument.ranging.tof.check_bins(BIN_WIDTH_M)
    if outputs.frequencies_hz or outputs.bins is not None:
        instrument.imaging  # noqa: B018 - raises for an instrument without pixels
    placed = InstrumentView.placed(scene, instrument)
    streams = streams_of(seed)
    world = build_world(scene, tracked_by(outputs.weights))
    if instrument.ranges and placed.zones is None:  # which see glints
        warn_of_glints(world, placed.beams, placed.tof)
    steady = steady_light(
        scene, instrument, world, placed, streams[2:], path_weights=outputs.weights
    )
    dropped, steady_extra = steady.pop("dropped"), steady.pop("extra")
    image, (spots, lengths_m) = NO_IMAGE, (NO_SPOTS, np.zeros(0))
    if instrument.images:
        image = _image(
            instrument,
            world,
            placed,
            steady["daylight_w"],
            (spp, transport_noise_share),
            outputs,
            streams[0],
            _part(progress, 0.1, 0.8),
        )
    if instrument.ranges:
        spots, lengths_m = trace_spots(
            instrument,
            world,
            placed,
            steady,
            (spp, transport_noise_share),
            streams[1],
            _part(progress, 0.8, 1.0),
            outputs.weights,
        )
    seconds, shape = time.perf_counter() - began, placed.projector.shape
    logger.info(
        "light of %s: %d paths in %.1f s; error over the detectors' noise %.2g, of spots %.2g",
        scene.name,
        image.paths + spots.paths,
        seconds,
        image.size,
        spots.size,
    )
    return Transport(
        image=image.mean["image"].reshape(shape),
        image_error=image_error(image, shape),
        **spot_fields(spots, lengths_m),
        **steady,
        noise_share=image.size,
        dropped=image.dropped + spots.dropped + dropped,
        paths=image.paths + spots.paths,
        seconds=seconds,
        extra=extra_light(outputs, image.mean if instrument.images else None, spots.mean, shape)
        | weighted_light(outputs, image if instrument.images else None, spots, shape)
        | steady_extra,
    )


def streams_of(seed: int) -> list[np.random.SeedSequence]:
    """Random streams of image, spots, and three kinds of steady light."""
    return np.random.SeedSequence(seed, spawn_key=(1,)).spawn(5)


def spot_fields(spots: Estimate, lengths_m: Floats) -> dict[str, Any]:
    """Fields of `Transport` of the light of the lasers."""
    return {
        "spot_histogram": spots.mean["histogram"],
        "spot_histogram_error": spot_error(spots),
        "path_length_m": lengths_m,
        "spot_noise_share": spots.size,
    }


def _image(
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    daylight_w: float,
    sampling: SampleBudget,
    outputs: Outputs,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
) -> Estimate:
    """Light of the projector on the bucket detector."""
    spp, noise_share = sampling
    error_metric = image_error_metric(instrument, daylight_w)
    budget: SamplingBudget = PathBudget(spp, error_metric=error_metric)
    if noise_share is not None:
        budget = TargetError(
            noise_share,
            error_metric,
            1 if placed.projector.pixels % 2 else MIN_PATHS,
            min_launches=MIN_IMAGES,
            growth=GROWTH,
        )
    return transport_image(
        world,
        placed.projector,
        placed.bucket,
        budget,
        seed=seed,
        outputs=outputs,
        progress=progress,
    )


def trace_spots(
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    steady: Mapping[str, Any],
    sampling: SampleBudget,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
    path_weights: Sequence[PathWeight] = (),
) -> tuple[Estimate, Floats]:
    """Light of the lasers on their detectors, and the path lengths (bins,) of its histogram."""
    spp, noise_share = sampling
    longest_m = 2 * instrument.ranging.tof.unambiguous_range_m
    bins = spot_bins(
        world.axis_distance_m(placed.beams), instrument.ranging.tof.unambiguous_range_m
    )
    error_metric = spot_error_metric(
        instrument,
        steady["spot_daylight_w"],
        steady["spot_crosstalk_w"],
        2 * np.pi / longest_m * bins.centres_m,
    )
    budget: SamplingBudget = PathBudget(SPOT_PATHS_PER_SPP * spp, error_metric=error_metric)
    if noise_share is not None:
        budget = TargetError(noise_share, error_metric, FIRST_SPOT_PATHS, growth=GROWTH)
    result = ranging_histogram(
        world, placed, bins, budget, seed=seed, path_weights=path_weights, progress=progress
    )
    return result, bins.centres_m


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


def steady_light(
    scene: Scene,
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    streams: Sequence[np.random.SeedSequence],
    *,
    target: float = STEADY_ERROR,
    max_vertices: int = MAX_VERTICES,
    path_weights: Sequence[PathWeight] = (),
) -> dict[str, Any]:
    """Fields of `Transport`: sun and sky on all detectors, the mean pattern on those of spots.

    `target` is their relative error; errors far below the dark current are tolerated, too. Light of
    the pattern that is scattered more than `max_vertices` times is left out. `path_weights` add
    weighted light to `extra`.
    """
    none = Received.none(0, path_weights)
    bucket, spots = (
        none
        if (detector := instrument.detectors.get(name)) is None
        else daylight_power(
            scene,
            instrument,
            world,
            view,
            floor_w=dark_power(instrument, detector, "daylight"),
            target=target,
            seed=stream,
            path_weights=path_weights,
        )
        for name, view, stream in (
            ("detector", placed.bucket, streams[0]),
            ("tof.detector", placed.zones or placed.tof, streams[1]),
        )
    )
    crosstalk = Received.none(len(placed.tof.positions_m), path_weights)
    if instrument.images and instrument.ranges:
        crosstalk = projector_power(
            world,
            placed.projector,
            instrument.mean_powers_w,
            placed.zones or placed.tof,
            floor_w=dark_power(instrument, instrument.ranging.tof.detector, "projector"),
            target=target,
            seed=streams[2],
            max_vertices=max_vertices,
            path_weights=path_weights,
        )
    return {
        "dropped": bucket.dropped + spots.dropped + crosstalk.dropped,
        "daylight_w": float(bucket.power_w.sum()),
        "daylight_error_w": float(np.linalg.norm(bucket.error_w)),
        "spot_daylight_w": spots.power_w,
        "spot_daylight_error_w": spots.error_w,
        "spot_crosstalk_w": crosstalk.power_w,
        "spot_crosstalk_error_w": crosstalk.error_w,
        "extra": steady_weighted(path_weights, bucket, spots, crosstalk),
    }


def dark_power(instrument: Instrument, detector: Detector, source: Source) -> float:
    """Light of a source on one aperture that makes as many electrons as the dark current, W."""
    return detector.sensor.dark_rate_hz / instrument.electrons_per_joule(detector, source)


def _part(
    progress: Callable[[float], None] | None, start: float, stop: float
) -> Callable[[float], None] | None:
    if progress is None:
        return None
    return lambda fraction: progress(start + fraction * (stop - start))
