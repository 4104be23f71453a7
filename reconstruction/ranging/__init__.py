"""From time-of-flight readings to ranges of the four spots."""

from .measure import measure_ranges
from .ranges import Ranges, Status

__all__ = ["Ranges", "Status", "measure_ranges"]
