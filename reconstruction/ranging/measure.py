"""The ranges of the four spots, by the method with which they were recorded."""

from functools import singledispatch

from ..spots import CwSpots, Spots
from .cw import cw_ranges
from .ranges import Ranges


@singledispatch
def measure_ranges(spots: Spots, frame: int = 0) -> Ranges:
    """Ranges of one frame; where a spot has none, its status says why."""
    raise TypeError(f"no ranging of {type(spots).__name__}")


measure_ranges.register(CwSpots, cw_ranges)
