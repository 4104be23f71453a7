"""Memory of a flight: points that ranges have met, and maps of the last frames."""

from .flight import FlightMemory, FrameRanges, Remembered
from .obstacles import LocalPoints, Met, free_of_met, met_in_corridor

__all__ = [
    "FlightMemory",
    "FrameRanges",
    "LocalPoints",
    "Met",
    "Remembered",
    "free_of_met",
    "met_in_corridor",
]
