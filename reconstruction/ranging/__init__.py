"""From time-of-flight readings to ranges of the four spots."""

from .measure import measure_ranges
from .ranges import Ranges, Status
from .unwrap import unambiguous_path_m

__all__ = ["Ranges", "Status", "measure_ranges", "unambiguous_path_m"]
