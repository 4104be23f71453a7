"""Put a simulated recording together, in the format that a rig writes too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np
import yaml

from reconstruction.capture import Capture, FrameTruth, Optics, Provenance, Truth
from spisim import __version__
from spisim.instrument import Instrument
from spisim.measurement.buckets import record_buckets
from spisim.measurement.drops import falling_drops
from spisim.measurement.light import bucket_light
from spisim.measurement.sequence import LightSequence, frame_time_s, trace
from spisim.measurement.spots import record_spots, spot_light
from spisim.scene import Scene
from spisim.transport import GroundTruth, Transport, ground_truth
from spisim.transport.backend import activate


@dataclass(frozen=True, eq=False)
class Simulation:
    """A capture, and the light it was made from."""

    capture: Capture
    transport: Transport
    truth: GroundTruth


def simulate(
    scene: Scene,
    instrument: Instrument,
    *,
    spp: int = 256,
    transport_noise: float | None = None,
    seed: int = 0,
    noise: bool = True,
    frames: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate a recording of `frames` frames, one after the other.

    Where something moves, the light is solved at key times and interpolated between exposures;
    the truth is that of the middle of the first frame.

    Parameters
    ----------
    spp
        Light paths per virtual pixel and strategy.
    transport_noise
        Instead of `spp`: relative standard error of the bucket vector to be reached.
    seed
        Equal seeds give equal captures on the same machine and backend.
    noise
        False: the expected readings of an ideal converter, as floating-point counts.
    progress
        Called with the fraction of the light transport that is done.

    Raises
    ------
    InputError
        If a laser beam hits nothing, an object would pass through the instrument, the scene was
        made for another wavelength than the instrument's, or no backend for the light transport
        works.
    """
    truth = ground_truth(scene.at(frame_time_s(instrument) / 2), instrument)
    light = trace(
        scene,
        instrument,
        frames=frames,
        spp=spp,
        noise=transport_noise,
        seed=seed,
        progress=progress,
    )
    effort = {"spp": spp} if transport_noise is None else {"transport_noise": transport_noise}
    how = {**effort, "backend": activate()}
    capture = record(
        scene, instrument, light, truth, seed=seed, noise=noise, frames=frames, settings=how
    )
    return Simulation(capture, light.transports[0], truth)


def record(
    scene: Scene,
    instrument: Instrument,
    light: LightSequence,
    truth: GroundTruth,
    *,
    seed: int,
    noise: bool = True,
    frames: int = 1,
    settings: Mapping[str, Any] | None = None,
) -> Capture:
    """Turn light into the capture that `instrument` would record.

    `settings` tells how the light was traced. With noise and frames it goes into the provenance,
    so that the capture can be made again; with the media, so that it tells their optics.
    """
    told = {"noise": noise, "frames": frames, "media": scene.media_summary()}
    settings = {**(settings or {}), **told}
    streams = np.random.SeedSequence(seed).spawn(3)
    for_buckets, for_spots, for_drops = (np.random.default_rng(stream) for stream in streams)
    drops = falling_drops(scene, instrument, truth, frames, for_drops)
    mean = bucket_light(instrument, light, frames, drops)
    buckets, pattern_taps = record_buckets(instrument, mean, for_buckets if noise else None)
    return Capture(
        plan=instrument.pattern_plan,
        buckets=buckets,
        spots=record_spots(
            instrument.tof,
            spot_light(instrument, light, frames, drops),
            instrument.lasers.directions,
            for_spots if noise else None,
        ),
        pattern_taps=pattern_taps,
        optics=Optics(
            tan_half_width=instrument.projector.tan_half_width,
            tan_half_height=instrument.projector.tan_half_height,
        ),
        provenance=Provenance(
            source="simulation",
            software=f"spisim {__version__}",
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            instrument=instrument.text,
            scene=scene.text,
            seed=seed,
            settings=yaml.safe_dump(settings, sort_keys=False),
        ),
        truth=Truth.of(
            [
                FrameTruth(
                    image=mean.image.astype(np.float32),
                    image_error=mean.image_error.astype(np.float32),
                    range_m=truth.range_m,
                    depth_m=truth.depth_m,
                    reflectance=truth.reflectance,
                    spot_range_m=truth.spot_range_m,
                )
            ],
            still=not scene.moves,
        ),
    )
