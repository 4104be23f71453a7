"""All the light that an instrument receives from a scene."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.daylight import daylight_power
from spisim.transport.estimator import spot_histogram, transport_image
from spisim.transport.views import Floats, InstrumentView
from spisim.transport.world import build_world

#: Optical path per histogram bin, and the longest path told apart from longer ones: 40 m of range
#: covers what four of the phase's ambiguity intervals hold, and fog tails beyond it are nothing.
BIN_WIDTH_M = 0.02
LONGEST_PATH_M = 80.0
#: Laser paths per `spp`: four beams need far fewer paths than thousands of pixels.
SPOT_SAMPLES_PER_SPP = 64
#: Daylight is smooth over the field; this many paths find it to about a percent.
DAYLIGHT_SAMPLES = 2**16


@dataclass(frozen=True, eq=False)
class Transport:
    """Light transport of one scene and instrument: fractions of emitted power, and daylight.

    `*_error` are standard errors of the Monte Carlo estimate.
    """

    image: Floats  # (H, W): fraction of a virtual pixel's power on the bucket detector's aperture
    image_error: Floats
    spot_histogram: Floats  # (4, bins): fraction of a laser's power on its detector's aperture
    spot_histogram_error: Floats
    path_length_m: Floats  # (bins,): whole optical path, emitter to detector
    daylight_w: float  # in-band power of sun and sky on the bucket detector's aperture
    spot_daylight_w: Floats  # (4,)
    paths: int
    seconds: float


@with_backend
def solve(
    scene: Scene,
    instrument: Instrument,
    *,
    spp: int = 256,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Transport:
    """Trace the light of projector, lasers and sky through the scene, once for all patterns.

    `spp` paths per virtual pixel from either end. The same seed gives the same bits on the same
    machine and backend. `progress` is called with the fraction done.
    """
    began = time.perf_counter()
    streams = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(3)
    world = build_world(scene)
    placed = InstrumentView.of(instrument, scene.drone_pose)
    image = transport_image(
        world,
        placed.projector,
        placed.bucket,
        spp=spp,
        seed=streams[0],
        progress=_part(progress, 0.0, 0.7),
    )
    bins = round(LONGEST_PATH_M / BIN_WIDTH_M) + 1
    spots = spot_histogram(
        world,
        placed.beams,
        placed.tof,
        bins=bins,
        bin_width_m=BIN_WIDTH_M,
        samples=spp * SPOT_SAMPLES_PER_SPP,
        seed=streams[1],
        progress=_part(progress, 0.7, 0.9),
    )
    daylight_seeds = streams[2].generate_state(2)
    bucket_daylight, spot_daylight = (
        daylight_power(scene, instrument, view, samples=DAYLIGHT_SAMPLES, seed=int(stream))
        for view, stream in zip((placed.bucket, placed.tof), daylight_seeds, strict=True)
    )
    if progress is not None:
        progress(1.0)
    return Transport(
        image=image.mean,
        image_error=image.error,
        spot_histogram=spots.mean,
        spot_histogram_error=spots.error,
        path_length_m=np.arange(bins, dtype=np.float64) * BIN_WIDTH_M,
        daylight_w=float(bucket_daylight[0]),
        spot_daylight_w=spot_daylight,
        paths=image.paths + spots.paths,
        seconds=time.perf_counter() - began,
    )


def _part(
    progress: Callable[[float], None] | None, start: float, stop: float
) -> Callable[[float], None] | None:
    if progress is None:
        return None
    return lambda fraction: progress(start + fraction * (stop - start))
