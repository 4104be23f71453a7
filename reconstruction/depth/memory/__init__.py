"""Memory of a flight: points that ranges have met, and maps of the last frames."""

from .flight import FlightMemory, FrameRanges, Remembered
from .obstacles import Met, free_of_met

__all__ = ["FlightMemory", "FrameRanges", "Met", "Remembered", "free_of_met"]
