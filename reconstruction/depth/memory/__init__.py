"""Memory of a flight: points that ranges have met, and maps of the last frames."""

from .flight import FlightMemory, FrameRanges, Remembered

__all__ = ["FlightMemory", "FrameRanges", "Remembered"]
