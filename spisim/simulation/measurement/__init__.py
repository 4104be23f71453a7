"""Light becomes counts: photo-electrons, noise, converter, capture."""

from spisim.simulation.measurement.capture import (
    frame_truth,
    record,
    record_frames,
    recorded_optics,
)
from spisim.simulation.measurement.diagnostics import simulation_warnings
from spisim.simulation.measurement.electronics import Memory
from spisim.simulation.measurement.light import BucketLight, bucket_light
from spisim.simulation.measurement.spots import spot_light

__all__ = [
    "BucketLight",
    "Memory",
    "bucket_light",
    "frame_truth",
    "record",
    "record_frames",
    "recorded_optics",
    "simulation_warnings",
    "spot_light",
]
