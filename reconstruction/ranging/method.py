"""What a method of ranging is."""

from collections.abc import Callable
from typing import Protocol

from ..capture import Spots
from .ranges import Ranges

RangingSolver = Callable[[Spots], Ranges]
"""From the readings of one frame to the ranges of the four spots."""


class RangingMethod(Protocol):
    """A way from readings to ranges; everything that frames share is done by `compile`."""

    title: str
    """A few words for plots and tables."""
    reads: type[Spots] | tuple[type[Spots], ...]
    """The kinds of readings that it understands."""

    def compile(self, spots: Spots) -> RangingSolver:
        """Solver of readings of this recording, of which ``spots`` holds none.

        Raises InputError where the recording does not tell what the method needs.
        """

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range from which on a spot looks nearer than it is; infinite where none does."""
