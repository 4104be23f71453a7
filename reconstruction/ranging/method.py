"""Interface of a ranging method."""

from typing import Protocol

from ..capture import Optics, Spots
from .brightness import Brightness
from .ranges import Ranges


class RangingSolver(Protocol):
    """Maps the readings of a frame to the ranges of the spots."""

    def __call__(self, spots: Spots, brightness: Brightness | None = None) -> Ranges:
        """Ranges; ``brightness`` is that of the frame's image at the spots, if known."""


class RangingMethod(Protocol):
    """A ranging method; `compile` does the work that frames share."""

    title: str
    """Short title for plots and tables."""
    reads: type[Spots] | tuple[type[Spots], ...]
    """Kinds of readings that the method understands."""

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver for a recording with these settings of the spots, whose readings are ignored.

        Raises InputError if the recording lacks what the method needs.
        """

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range beyond which a spot appears nearer than it is; infinite if none does."""
