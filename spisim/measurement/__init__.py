"""Light becomes counts: photo-electrons, noise, converter, capture."""

from spisim.measurement.capture import Simulation, record, simulate
from spisim.measurement.findings import simulation_warnings
from spisim.measurement.light import BucketLight, bucket_light
from spisim.measurement.sequence import LightSequence, trace
from spisim.measurement.spots import SpotLight, record_spots, spot_light

__all__ = [
    "BucketLight",
    "LightSequence",
    "Simulation",
    "SpotLight",
    "bucket_light",
    "record",
    "record_spots",
    "simulate",
    "simulation_warnings",
    "spot_light",
    "trace",
]
