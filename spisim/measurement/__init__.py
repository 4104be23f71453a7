"""Light becomes counts: photo-electrons, noise, converter, capture."""

from spisim.measurement.capture import frame_truth, record, record_frames, told_optics
from spisim.measurement.diagnostics import simulation_warnings
from spisim.measurement.electronics import Memory
from spisim.measurement.light import BucketLight, bucket_light
from spisim.measurement.spots import spot_light

__all__ = [
    "BucketLight",
    "Memory",
    "bucket_light",
    "frame_truth",
    "record",
    "record_frames",
    "simulation_warnings",
    "spot_light",
    "told_optics",
]
