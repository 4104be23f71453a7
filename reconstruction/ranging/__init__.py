"""From time-of-flight taps to ranges of the four spots."""

from .cw import Ranges, Status, measure_ranges

__all__ = ["Ranges", "Status", "measure_ranges"]
