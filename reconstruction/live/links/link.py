"""What all ways have in common that bytes come or go."""

from abc import ABC, abstractmethod
from typing import ClassVar

PIECE_BYTES = 2**16
"""Most that is read at a time."""


class Ended(Exception):
    """A source has nothing more to give, and never will."""


class Link:
    """One way, which can be opened again after it broke; then its methods raise OSError."""

    def __init__(self, address: str) -> None:
        self.address = address

    def check(self) -> None:
        """Raise InputError where it can never be opened."""

    def open(self) -> None:
        """Open it where it is not open from the beginning, or again; waits a second at most."""

    @property
    def wanted(self) -> bool:
        """Whether somebody else waits for the place of who is connected: `open` lets it in."""
        return False

    def close(self) -> None:
        """Close it, from any thread: whoever waits for it is woken."""


class Source(Link, ABC):
    """Where bytes come from."""

    patient: ClassVar[bool] = False
    """Whether whoever sends waits for whoever reads, so that nothing need be dropped."""
    forgeable: ClassVar[bool] = False
    """Whether anybody can send in the name of another."""
    sender: str = ""
    """Who sent what was received last, where there may be several."""

    @abstractmethod
    def receive(self, timeout_s: float) -> bytes:
        """Some bytes, none if none came for so long; raises `Ended` after the last."""


class Outlet(Link, ABC):
    """Where bytes go."""

    @abstractmethod
    def send(self, content: bytes) -> None:
        """Send all of them, however long it takes."""
