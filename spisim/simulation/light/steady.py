"""Steady light on all detectors: daylight, and the projector's on those of the spots."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from spisim.instrument import Detector, Instrument
from spisim.instrument.model import Source
from spisim.scene import Scene
from spisim.simulation.light.extra import steady_weighted
from spisim.transport.daylight import STEADY_ERROR, Received, daylight_power, projector_power
from spisim.transport.engine.path_weights import PathWeight
from spisim.transport.engine.walk import MAX_VERTICES
from spisim.transport.views import InstrumentView
from spisim.transport.world import World


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
