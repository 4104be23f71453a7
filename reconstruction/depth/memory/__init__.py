"""Memory of a flight: points that ranges have met, and maps of the last frames."""

from .flight import FlightMemory, FrameRanges, Remembered
from .unwrap import Possible

__all__ = ["FlightMemory", "FrameRanges", "Possible", "Remembered"]
