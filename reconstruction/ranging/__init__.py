"""From time-of-flight taps to ranges of the four spots."""

from .cw import Ranges, measure_ranges

__all__ = ["Ranges", "measure_ranges"]
