"""Simulated recordings, in the format of real ones."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture, Frames, FrameTruth, Optics, Provenance, Truth
from reconstruction.capture.importers import capture_from_spots
from spisim.base.config import dump_yaml
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.drops import falling_drops
from spisim.simulation.light import Light, Steered
from spisim.simulation.measurement.buckets import record_buckets
from spisim.simulation.measurement.electronics import Memory
from spisim.simulation.measurement.light import BucketLight, bucket_light, no_light, pixel_electrons
from spisim.simulation.measurement.spots import spot_light
from spisim.transport import GroundTruth
from spisim.version import __version__


def record(
    scene: Scene,
    instrument: Instrument,
    light: Light,
    truths: Sequence[GroundTruth],
    *,
    seed: int,
    noise: bool = True,
    frames: int = 1,
    settings: Mapping[str, Any] | None = None,
    steered: Steered | None = None,
) -> Capture:
    """Turn light into the capture that `instrument` would record.

    `truths` are those of every frame, or one for all if nothing moves; `steered` is the light of
    steered spots, whose frames each have a truth. `settings` describes how the
    light was traced. The provenance records it, with noise and frames, so that the capture can be
    made again, and with the optics of the media.
    """
    made = {"noise": noise, "frames": frames, "media": scene.media_summary()}
    settings = {**(settings or {}), **made}
    streams = np.random.SeedSequence(seed)
    readings, mean = record_frames(
        scene, instrument, light, truths, streams, noise=noise, frames=frames, steered=steered
    )
    plan, *following_plans = instrument.recorded_plans[:frames]
    return Capture(
        plan=plan,
        following_plans=tuple(following_plans),
        buckets=readings.buckets,
        spots=readings.spots,
        pattern_taps=readings.pattern_taps,
        optics=recorded_optics(instrument),
        provenance=Provenance(
            source="simulation",
            software=f"spisim {__version__}",
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            instrument=instrument.text,
            scene=scene.text,
            seed=seed,
            settings=dump_yaml(settings),
        ),
        truth=Truth.of(
            [
                frame_truth(image, error, truth)
                for image, error, truth in zip(
                    *(
                        np.broadcast_to(each, (len(truths), *each.shape[1:]))
                        for each in (mean.image, mean.image_error)
                    ),
                    truths,
                    strict=True,
                )
            ],
            still=not scene.moves and steered is None,
        ),
    )


def record_frames(
    scene: Scene,
    instrument: Instrument,
    light: Light,
    truths: Sequence[GroundTruth],
    streams: np.random.SeedSequence,
    *,
    noise: bool = True,
    frames: int = 1,
    first: int = 0,
    before: Memory | None = None,
    steered: Steered | None = None,
) -> tuple[Frames, BucketLight]:
    """Readings of successive frames, and the bucket's light that they were made from.

    `first` is the index of the first frame; `truths` and `steered` are as for `record`, `before` as
    for `bucket_light`.
    """
    for_buckets, for_spots, for_drops = (
        np.random.default_rng(stream) for stream in streams.spawn(3)
    )
    drops = falling_drops(scene, instrument, truths, frames, for_drops)
    spots = pattern_taps = None
    if instrument.ranges:
        spots = instrument.ranging.tof.record(
            spot_light(instrument, light if steered is None else steered.light, frames, drops),
            instrument.spot_optics,
            for_spots if noise else None,
        )
        if steered is not None and steered.pointing is not None:
            spots = replace(spots, pointing=steered.pointing.read)
    if instrument.images:
        mean = bucket_light(instrument, light, frames, drops, first=first, before=before)
        buckets, pattern_taps = record_buckets(
            instrument, mean, for_buckets if noise else None, first
        )
    else:
        assert spots is not None
        mean, buckets = no_light(frames, max(1, len(truths))), capture_from_spots(spots).buckets
    return Frames(first, buckets, spots, pattern_taps), mean


def recorded_optics(instrument: Instrument) -> Optics | None:
    """Optics of projector and bucket detector as captures state them; None without a projector."""
    if not instrument.images:
        return None
    detector, electrons = instrument.imaging.detector, pixel_electrons(instrument)
    return Optics(
        tan_half_width=instrument.imaging.projector.tan_half_width,
        tan_half_height=instrument.imaging.projector.tan_half_height,
        detector_positions_m=np.array(detector.positions_m, dtype=np.float64),
        detector_half_field_rad=math.radians(detector.field_of_view_deg) / 2,
        detector_falloff=detector.vignetting,
        detector_aperture_radius_m=math.sqrt(detector.aperture_area_m2 / math.pi),
        pixel_electrons=electrons if np.ptp(electrons) else float(electrons.flat[0]),
    )


def frame_truth(image: Floats, image_error: Floats, truth: GroundTruth) -> FrameTruth:
    """Truth of a frame, with its image (H, W) in electrons per exposure."""
    return FrameTruth(
        image=image.astype(np.float32),
        image_error=image_error.astype(np.float32),
        range_m=truth.range_m,
        depth_m=truth.depth_m,
        reflectance=truth.reflectance,
        spot_range_m=truth.spot_range_m,
        corridor_m=truth.corridor_m,
        position_m=truth.pose[:3, 3],
        orientation=Rotation.from_matrix(truth.pose[:3, :3]).as_quat(),
    )
