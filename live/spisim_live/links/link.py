"""Base classes of links."""

from abc import ABC, abstractmethod
from typing import ClassVar

PIECE_BYTES = 2**16
"""Maximum number of bytes per read."""


class Ended(Exception):
    """A source has nothing more to give."""


class Link:
    """A link that can be reopened after it broke; its methods raise OSError then."""

    def __init__(self, address: str) -> None:
        self.address = address

    def check(self) -> None:
        """Raise InputError if it can never be opened."""

    def open(self) -> None:
        """Open or reopen it; waits a second at most."""

    @property
    def wanted(self) -> bool:
        """Whether another sender waits for the place of the connected one; `open` lets it in."""
        return False

    def close(self) -> None:
        """Close it, from any thread, waking all that wait."""


class Source(Link, ABC):
    """Where bytes come from."""

    patient: ClassVar[bool] = False
    """Whether the sender waits for the reader, so that nothing need be dropped."""
    forgeable: ClassVar[bool] = False
    """Whether anybody can send under another's address."""
    sender: str = ""
    """Sender of what was received last, if there may be several."""

    @abstractmethod
    def receive(self, timeout_s: float) -> bytes:
        """Some bytes, none after the timeout; raises `Ended` after the last."""


class Outlet(Link, ABC):
    """Where bytes go."""

    @abstractmethod
    def send(self, content: bytes) -> None:
        """Send all bytes, however long it takes."""
