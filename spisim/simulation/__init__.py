"""Scene and instrument to light, counts and a capture: the one place that runs the whole chain."""

from spisim.simulation.chain import Simulation, simulate

__all__ = ["Simulation", "simulate"]
