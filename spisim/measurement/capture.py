"""Put a simulated recording together, in the format that a rig writes too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import numpy as np
import yaml

from reconstruction.capture import Buckets, Capture, Optics, Provenance, Truth
from reconstruction.spots import CwSpots
from spisim.instrument import Instrument
from spisim.measurement.electronics import expected_readings, read_out
from spisim.measurement.light import mean_electrons
from spisim.measurement.sequence import LightSequence, frame_time_s, trace
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
        If a laser beam hits nothing, an object would pass through the instrument, or no backend
        for the light transport works.
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
    so that the capture can be made again.
    """
    settings = {**(settings or {}), "noise": noise, "frames": frames}
    mean = mean_electrons(instrument, light, frames)
    bucket, tof = instrument.detector, instrument.tof
    if noise:
        for_buckets, for_taps = (
            np.random.default_rng(stream) for stream in np.random.SeedSequence(seed).spawn(2)
        )
        buckets = read_out(mean.buckets, bucket, instrument.exposure_time_s, for_buckets)
        taps = read_out(mean.taps, tof.detector, tof.tap_time_s, for_taps)
    else:
        buckets = expected_readings(mean.buckets, bucket)
        taps = expected_readings(mean.taps, tof.detector)
    return Capture(
        plan=instrument.pattern_plan,
        buckets=Buckets(
            counts=buckets.counts,
            saturated=buckets.saturated,
            exposure_time_s=instrument.exposure_time_s,
            pattern_period_s=1 / instrument.projector.pattern_rate_hz,
            electrons_per_count=bucket.adc.electrons_per_count,
            offset_counts=bucket.adc.offset_counts,
            noise_electrons=buckets.noise_electrons,
            excess_noise_factor=1.0,
            dead_time_s=0.0,
        ),
        spots=CwSpots(
            taps=taps.counts,
            saturated=taps.saturated,
            directions=instrument.lasers.directions,
            detector_positions_m=np.asarray(tof.detector.positions_m, dtype=np.float64),
            tap_frequencies_hz=np.full(tof.tap_phases_rad.size, tof.modulation_frequency_hz),
            tap_phases_rad=tof.tap_phases_rad,
            phase_offsets_rad=np.zeros(tof.tap_phases_rad.size),
            periods=tof.periods,
            electrons_per_count=tof.detector.adc.electrons_per_count,
            offset_counts=tof.detector.adc.offset_counts,
            noise_electrons=taps.noise_electrons,
            excess_noise_factor=1.0,
        ),
        optics=Optics(
            tan_half_width=instrument.projector.tan_half_width,
            tan_half_height=instrument.projector.tan_half_height,
        ),
        provenance=Provenance(
            source="simulation",
            software=f"spisim {version('spisim')}",
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            instrument=instrument.text,
            scene=scene.text,
            seed=seed,
            settings=yaml.safe_dump(settings, sort_keys=False),
        ),
        truth=Truth(
            image=mean.image.astype(np.float32),
            image_error=mean.image_error.astype(np.float32),
            range_m=truth.range_m,
            depth_m=truth.depth_m,
            reflectance=truth.reflectance,
            spot_range_m=truth.spot_range_m,
        ),
    )
