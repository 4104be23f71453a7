"""Light becomes counts: photo-electrons, noise, converter, capture."""

from spisim.measurement.capture import Simulation, record, simulate
from spisim.measurement.light import MeanElectrons, mean_electrons
from spisim.measurement.sequence import LightSequence, trace

__all__ = [
    "LightSequence",
    "MeanElectrons",
    "Simulation",
    "mean_electrons",
    "record",
    "simulate",
    "trace",
]
