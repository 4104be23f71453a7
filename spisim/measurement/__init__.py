"""Light becomes counts: photo-electrons, noise, converter, capture."""

from spisim.measurement.capture import Simulation, record, simulate
from spisim.measurement.light import MeanElectrons, mean_electrons

__all__ = ["MeanElectrons", "Simulation", "mean_electrons", "record", "simulate"]
