"""The whole chain, from scene and instrument to light, counts and a capture."""

from spisim.simulation.chain import Simulation, simulate, simulate_from

__all__ = ["Simulation", "simulate", "simulate_from"]
