"""What all sinks have in common."""

from typing import ClassVar

from ..reception import Arrival
from ..results import Outcome, State


class Sink:
    """Takes what it is there for, and ignores the rest; what it raises costs that alone."""

    waiting: ClassVar[int] = 16
    """How many may wait for it, before the oldest are dropped."""
    skips: ClassVar[bool] = False
    """Whether it is there for the newest alone, and the others are not missed."""
    fleeting: ClassVar[bool] = False
    """Whether what cannot be sent is no failure, as nobody need be there to take it."""

    def check(self) -> None:
        """Raise InputError where it can never take anything."""

    def frame(self, arrival: Arrival) -> None:
        """One more frame, as it came."""

    def result(self, outcome: Outcome) -> None:
        """One more result."""

    def state(self, state: State) -> None:
        """How the stream is, once a second."""

    def close(self) -> None:
        """Nothing more will come."""

    def abandon(self) -> None:
        """Let go of whatever it waits for; called from another thread."""
