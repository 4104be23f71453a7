"""What a method of ranging is."""

from typing import Protocol

from ..capture import Optics, Spots
from .brightness import Brightness
from .ranges import Ranges


class RangingSolver(Protocol):
    """From the readings of one frame to the ranges of the four spots."""

    def __call__(self, spots: Spots, brightness: Brightness | None = None) -> Ranges:
        """Ranges; ``brightness`` is what the frame's image shows at the spots, if it is known."""


class RangingMethod(Protocol):
    """A way from readings to ranges; everything that frames share is done by `compile`."""

    title: str
    """A few words for plots and tables."""
    reads: type[Spots] | tuple[type[Spots], ...]
    """The kinds of readings that it understands."""

    def compile(self, spots: Spots, optics: Optics | None = None) -> RangingSolver:
        """Solver of readings of this recording, of which ``spots`` holds none.

        ``optics`` are those of projector and bucket detector, if they are known.

        Raises InputError where the recording does not tell what the method needs.
        """

    def unambiguous_range_m(self, spots: Spots) -> float:
        """Range from which on a spot looks nearer than it is; infinite where none does."""
