"""All the light that an instrument receives from a scene."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.arrays import Floats
from reconstruction.operators import expose
from reconstruction.ranging import MAX_PATH_M
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.daylight import daylight_power, projector_power
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import Paths, SamplingBudget, TargetError
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.views import InstrumentView
from spisim.transport.world import World, build_world

#: Optical path per histogram bin. Paths beyond MAX_PATH_M, which no range is looked for beyond, are
#: not told apart: fog tails there are nothing.
BIN_WIDTH_M = 0.02
#: Laser paths per `spp`: four beams need far fewer paths than thousands of pixels.
SPOT_PATHS_PER_SPP = 64
#: Paths for steady light, which is smooth over the field and felt by its shot noise alone: a share
#: of the image's, within bounds that find it to about 5 and 2 percent.
STEADY_SHARE = 1 / 16
STEADY_PATHS = (2**14, 2**16)


@dataclass(frozen=True, eq=False)
class Transport:
    """Light transport of one scene and instrument: fractions of emitted power, and daylight.

    `*_error` are standard errors of the Monte Carlo estimate. `extra` has what `Outputs` asked for:
    `phasors` (F, H, W), complex; `cube` (H, W, bins) and `cube_path_length_m` (bins,); and, split
    into unscattered, single and multiple, `orders` (3, H, W) of the image, `phasor_orders`
    (3, F, H, W), `cube_orders` (3, H, W, bins) and `spot_orders` (3, 4, bins).
    """

    image: Floats  # (H, W): fraction of a virtual pixel's power on the bucket detector's apertures
    image_error: Floats
    spot_histogram: Floats  # (4, bins): fraction of a laser's power on its detector's aperture
    spot_histogram_error: Floats
    path_length_m: Floats  # (bins,): whole optical path, emitter to detector
    daylight_w: float  # in-band power of sun and sky on the bucket detectors' apertures
    spot_daylight_w: Floats  # (4,)
    spot_crosstalk_w: Floats  # (4,): mean power of the projector's patterns there
    paths: int
    seconds: float
    extra: Mapping[str, NDArray[Any]]  # as above


@with_backend
def solve(
    scene: Scene,
    instrument: Instrument,
    *,
    spp: int = 256,
    transport_error: float | None = None,
    seed: int = 0,
    outputs: Outputs = Outputs(),  # noqa: B008
    progress: Callable[[float], None] | None = None,
) -> Transport:
    """Trace the light of projector, lasers and sky through the scene, once for all patterns.

    Parameters
    ----------
    spp
        Paths per virtual pixel from either end.
    transport_error
        Instead of `spp`: go on until the relative standard error of the bucket vector, ‖errors‖ /
        ‖readings‖, is below this.
    seed
        The same seed gives the same bits on the same machine and backend.
    outputs
        What to keep besides the transport image.
    progress
        Called with the fraction done.

    Raises
    ------
    InputError
        If the scene was made for another wavelength than the instrument's, the histograms are too
        coarse for what is modulated onto the light, or more light returns than can be summed.

    Warns
    -----
    TransportWarning
        If some light was not a finite number and is left out.
    """
    began = time.perf_counter()
    instrument.tof.check_bins(BIN_WIDTH_M)
    placed = InstrumentView.placed(scene, instrument)
    streams = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(5)
    world = build_world(scene)
    image = transport_image(
        world,
        placed.projector,
        placed.bucket,
        _budget(instrument, spp, transport_error),
        seed=streams[0],
        outputs=outputs,
        progress=_part(progress, 0.0, 0.7),
    )
    bins = PathLengthBins.up_to(MAX_PATH_M, BIN_WIDTH_M)
    spots = spot_histogram(
        world,
        placed.beams,
        placed.tof,
        bins,
        Paths(image.paths // (2 * placed.projector.pixels) * SPOT_PATHS_PER_SPP),
        seed=streams[1],
        progress=_part(progress, 0.7, 0.9),
    )
    steady = _steady_light(scene, instrument, world, placed, image.paths, streams[2:])
    if progress is not None:
        progress(1.0)
    shape = placed.projector.shape
    return Transport(
        image=image.mean["image"].reshape(shape),
        image_error=image.error["image"].reshape(shape),
        spot_histogram=spots.mean["histogram"],
        spot_histogram_error=spots.error["histogram"],
        path_length_m=bins.centres_m,
        **steady,
        paths=image.paths + spots.paths,
        seconds=time.perf_counter() - began,
        extra=_extra(outputs, image.mean, spots.mean, shape),
    )


def _steady_light(
    scene: Scene,
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    image_paths: int,
    streams: Sequence[np.random.SeedSequence],
) -> dict[str, Any]:
    """Fields of `Transport`: sun and sky on all detectors, the mean pattern on those of spots."""
    paths = int(np.clip(image_paths * STEADY_SHARE, *STEADY_PATHS))
    bucket, spots = (
        daylight_power(scene, instrument, world, view, paths=paths, seed=stream)
        for view, stream in zip((placed.bucket, placed.tof), streams[:2], strict=True)
    )
    crosstalk = projector_power(
        world,
        placed.projector,
        instrument.mean_powers_w,
        placed.tof,
        paths=paths,
        seed=streams[2],
    )
    return {
        "daylight_w": float(bucket.sum()),
        "spot_daylight_w": spots,
        "spot_crosstalk_w": crosstalk,
    }


def _budget(instrument: Instrument, spp: int, transport_error: float | None) -> SamplingBudget:
    if transport_error is None:
        return Paths(spp)
    plans, power_w = instrument.pattern_plans, instrument.pixel_powers_w

    def buckets(sums: Mapping[str, Floats]) -> Floats:
        image = sums["image"].reshape(power_w.shape) * power_w
        return np.concatenate([expose(plan, image) for plan in plans], axis=-1)

    return TargetError(transport_error, buckets)


def _extra(
    outputs: Outputs,
    image: Mapping[str, Floats],
    spots: Mapping[str, Floats],
    shape: tuple[int, int],
) -> dict[str, NDArray[Any]]:
    """Everything kept besides the image, with pixels as rows and columns."""
    extra: dict[str, NDArray[Any]] = {}
    if outputs.orders:
        extra["orders"] = image["image_orders"].reshape(-1, *shape)
        extra["spot_orders"] = spots["histogram_orders"]
    if outputs.frequencies_hz:
        extra["phasors"] = _phasors(image["phasors"], shape)
        if outputs.orders:
            extra["phasor_orders"] = _phasors(image["phasors_orders"], shape)
    if outputs.bins is not None:
        extra["cube"] = image["histogram"].reshape(*shape, -1)
        extra["cube_path_length_m"] = outputs.bins.centres_m
        if outputs.orders:
            extra["cube_orders"] = image["histogram_orders"].reshape(-1, *shape, outputs.bins.count)
    return extra


def _phasors(parts: Floats, shape: tuple[int, int]) -> NDArray[np.complex128]:
    """Complex images (..., F, H, W) from real and imaginary parts (..., H·W, F, 2)."""
    values = np.moveaxis(parts[..., 0] + 1j * parts[..., 1], -1, -2)
    return values.reshape(*values.shape[:-1], *shape)


def _part(
    progress: Callable[[float], None] | None, start: float, stop: float
) -> Callable[[float], None] | None:
    if progress is None:
        return None
    return lambda fraction: progress(start + fraction * (stop - start))
