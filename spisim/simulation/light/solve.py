"""All the light that an instrument receives from a scene."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene
from spisim.simulation.light.extra import extra_light, weighted_light
from spisim.simulation.light.noise_metric import image_error_metric
from spisim.simulation.light.other_fog import OtherFog, Reweighted, in_each, over_fogs
from spisim.simulation.light.path_bins import MIN_BIN_WIDTH_M
from spisim.simulation.light.spots import GROWTH, SampleBudget, bins_of, spot_metric, spots_of
from spisim.simulation.light.stated_error import image_error, spot_error
from spisim.simulation.light.steady import steady_light
from spisim.transport.backend import with_backend
from spisim.transport.engine.estimator import transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.path_weights import tracked_by
from spisim.transport.engine.sampling import (
    ErrorMetric,
    Estimate,
    PathBudget,
    SamplingBudget,
    TargetError,
)
from spisim.transport.glints import warn_of_glints
from spisim.transport.world import World, build_world

logger = logging.getLogger(__name__)

#: Minimum launches of the image towards a target error: enough, as many coefficients average it.
MIN_IMAGES = 5
#: Minimum paths per pixel and launch: each path has several rays, which gather most of the light.
MIN_PATHS = 0.5


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
    reweighted: Reweighted | None = None  # None for light of a pass through its own fog


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
    budget = (spp, transport_noise_share)
    return _solved(scene, instrument, (), budget, seed, outputs, progress)[0]


@with_backend
def solve_fogs(
    scene: Scene,
    instrument: Instrument,
    others: Sequence[OtherFog],
    *,
    spp: int = 256,
    transport_noise_share: float | None = None,
    seed: int = 0,
    outputs: Outputs = Outputs(),  # noqa: B008
    progress: Callable[[float], None] | None = None,
) -> tuple[Transport, ...]:
    """Light of a scene in its own fog, as `solve` traces it, and in others from the same paths.

    Steady light is traced in each fog. With `transport_noise_share`, paths are traced until the
    light in every fog is as good, except where a pass through that fog would cost less.

    Parameters
    ----------
    others
        Other fogs of the scene. `Transport.reweighted` of the light in one says how many paths
        carry it; `Reweighted.require_carried` refuses too few.
    scene, instrument, spp, transport_noise_share, seed, outputs, progress
        As of `solve`.

    Returns
    -------
    tuple of Transport
        In the scene's own fog, then in the others.

    Raises
    ------
    InputError
        As `solve`, where light up to 2048 times weaker is too much to be summed.
    """
    budget = (spp, transport_noise_share)
    return _solved(scene, instrument, others, budget, seed, outputs, progress)


def _solved(
    scene: Scene,
    instrument: Instrument,
    others: Sequence[OtherFog],
    sampling: SampleBudget,
    seed: int,
    outputs: Outputs,
    progress: Callable[[float], None] | None,
) -> tuple[Transport, ...]:
    began = time.perf_counter()
    _check_sampling(sampling)
    if instrument.ranges:
        instrument.ranging.tof.check_bins(MIN_BIN_WIDTH_M)
    if outputs.frequencies_hz or outputs.bins is not None:
        instrument.imaging  # noqa: B018 - raises for an instrument without pixels
    placed = InstrumentView.placed(scene, instrument)
    streams = streams_of(seed)
    world = build_world(scene, tracked_by(outputs.weights))
    if instrument.ranges and placed.zones is None:  # which see glints
        warn_of_glints(world, placed.beams, placed.tof)
    asked = outputs.weights
    steady = [
        steady_light(scene, instrument, world, placed, streams[2:], path_weights=asked),
        *(
            steady_light(each.scene, instrument, build_world(each.scene), placed, streams[2:])
            for each in others
        ),
    ]
    weights = tuple(weight for other in others for weight in other.weights)
    recorded = replace(outputs, weights=(*asked, *weights))
    images, spots, lengths_m = [NO_IMAGE] * len(steady), [NO_SPOTS] * len(steady), np.zeros(0)
    carried = [1.0] * len(others)
    if instrument.images:
        metrics = [image_error_metric(instrument, each["daylight_w"]) for each in steady]
        image = _image(
            world,
            placed,
            over_fogs(metrics, others),
            sampling,
            recorded,
            streams[0],
            _part(progress, 0.1, 0.8),
        )
        images = in_each(image, metrics, others)
        carried = [other.carried_image(image.mean) for other in others]
    if instrument.ranges:
        bins = bins_of(instrument, world, placed)
        metrics = [spot_metric(instrument, each, bins) for each in steady]
        result = spots_of(
            world,
            placed,
            bins,
            over_fogs(metrics, others),
            sampling,
            streams[1],
            _part(progress, 0.8, 1.0),
            recorded.weights,
        )
        spots, lengths_m = in_each(result, metrics, others), bins.centres_m
        each_carried = [other.carried_spots(result.mean) for other in others]
        carried = np.minimum(carried, each_carried).tolist()
    seconds, shape = time.perf_counter() - began, placed.projector.shape
    logger.info(
        "light of %s: %d paths in %.1f s; error over the detectors' noise %.2g, of spots %.2g",
        scene.name,
        images[0].paths + spots[0].paths,
        seconds,
        images[0].size,
        spots[0].size,
    )
    ratios = [other.ratio for other in others]
    how = [None, *(Reweighted(*each) for each in zip(ratios, carried, strict=True))]
    return tuple(
        _transport(instrument, *each, lengths_m, outputs, shape, seconds)
        for each in zip(images, spots, steady, how, strict=True)
    )


def _transport(
    instrument: Instrument,
    image: Estimate,
    spots: Estimate,
    steady: dict[str, Any],
    reweighted: Reweighted | None,
    lengths_m: Floats,
    outputs: Outputs,
    shape: tuple[int, int],
    seconds: float,
) -> Transport:
    """All light in one fog."""
    imaged = image if instrument.images else None
    if reweighted is not None:
        outputs = replace(outputs, weights=())
    return Transport(
        image=image.mean["image"].reshape(shape),
        image_error=image_error(image, shape),
        **spot_fields(spots, lengths_m),
        **{name: value for name, value in steady.items() if name not in ("dropped", "extra")},
        noise_share=image.size,
        dropped=image.dropped + spots.dropped + steady["dropped"],
        paths=image.paths + spots.paths,
        seconds=seconds,
        extra=extra_light(outputs, None if imaged is None else imaged.mean, spots.mean, shape)
        | weighted_light(outputs, imaged, spots, shape)
        | steady["extra"],
        reweighted=reweighted,
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


def _check_sampling(sampling: SampleBudget) -> None:
    spp, noise_share = sampling
    whole = isinstance(spp, int | np.integer) and not isinstance(spp, bool)
    if noise_share is None and not (whole and spp >= 1):
        raise InputError(f"spp is {spp!r}, must be a whole number of at least 1")


def _image(
    world: World,
    placed: InstrumentView,
    error_metric: ErrorMetric,
    sampling: SampleBudget,
    outputs: Outputs,
    seed: np.random.SeedSequence,
    progress: Callable[[float], None] | None,
) -> Estimate:
    """Light of the projector on the bucket detector."""
    spp, noise_share = sampling
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


def _part(
    progress: Callable[[float], None] | None, start: float, stop: float
) -> Callable[[float], None] | None:
    if progress is None:
        return None
    return lambda fraction: progress(start + fraction * (stop - start))
