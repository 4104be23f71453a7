"""Light becomes counts: photo-electrons, noise, converter, capture."""

from spisim.measurement.capture import record
from spisim.measurement.diagnostics import simulation_warnings
from spisim.measurement.light import BucketLight, bucket_light
from spisim.measurement.spots import spot_light

__all__ = [
    "BucketLight",
    "bucket_light",
    "record",
    "simulation_warnings",
    "spot_light",
]
