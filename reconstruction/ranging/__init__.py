"""From time-of-flight readings to ranges of the four spots, or of every virtual pixel."""

from .dense import dense_range
from .measure import measure_ranges
from .ranges import Ranges, Status
from .unwrap import unambiguous_path_m

__all__ = ["Ranges", "Status", "dense_range", "measure_ranges", "unambiguous_path_m"]
