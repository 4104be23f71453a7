"""Pack messages, and find them among garbage (docs/reference/stream-format.md)."""

import struct
import zlib
from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

from reconstruction.base.errors import InputError

MAGIC = b"SPI\x1a"
VERSION = 1
HEADER = struct.Struct("<4sBBHIIQII")
"""Magic, version, kind, run, number, bytes of payload, time, setup, CRC-32 of all before it."""
CRC = struct.Struct("<I")
MAX_PAYLOAD_BYTES = 2**24
MAX_BEGUN = 16
"""Maximum number of nested headers that are followed at once."""


class Kind(IntEnum):
    """Kind of a message."""

    SETUP = 1
    FRAME = 2
    END = 3
    RESULT = 4
    STATUS = 5
    COMMAND = 6


class Message(NamedTuple):
    """A message; ``payload`` is None if it is damaged or of another version.

    ``run`` identifies the start of the sender, ``number`` counts its frames, ``time_ns`` is its
    clock, ``setup`` the CRC-32 of the setup's payload.
    """

    kind: int
    payload: bytes | None = b""
    number: int = 0
    time_ns: int = 0
    run: int = 0
    setup: int = 0
    version: int = VERSION


def pack(message: Message) -> bytes:
    """Encode a message; raises InputError if its payload exceeds MAX_PAYLOAD_BYTES."""
    payload = message.payload or b""
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise InputError(
            f"a message of {len(payload)} bytes; at most {MAX_PAYLOAD_BYTES}: use fewer pixels, "
            "or fewer readings per frame"
        )
    return b"".join((header(message, len(payload)), payload, CRC.pack(zlib.crc32(payload))))


def header(message: Message, length: int) -> bytes:
    """Header of a message with a payload of so many bytes."""
    fields = (message.run, message.number, length, message.time_ns, message.setup)
    head = HEADER.pack(MAGIC, message.version, message.kind, *fields, 0)[: -CRC.size]
    return head + CRC.pack(zlib.crc32(head))


class Parser:
    """Finds messages in bytes as they come, in pieces of any size.

    Never raises, whatever the bytes, and holds at most one message and a piece. ``fits`` sees each
    header, as a message without payload, and its payload's length, and may reject it. A false
    header delays nobody: a sound message within an incomplete one shows that the latter was false
    or broke off. Such messages are ``given_up``; ``discarded_bytes`` belong to no sound message.
    """

    def __init__(self, fits: Callable[[Message, int], bool] = lambda message, length: True) -> None:
        self.discarded_bytes = 0
        self.given_up = 0
        self._fits = fits
        self._bytes = bytearray()
        self._searched = 0
        self._begun: list[_Begun] = []

    def feed(self, piece: bytes) -> list[Message]:
        """Messages that a piece completes, sound or not."""
        self._bytes += piece
        messages: list[Message] = []
        while self._complete(messages) or self._search(messages):
            pass
        self._discard(self._begun[0].at if self._begun else self._searched)
        return messages

    @property
    def waits(self) -> bool:
        """Whether a message is incomplete."""
        return bool(self._begun)

    def reset(self) -> None:
        """Drop the beginning of a message whose end will not come."""
        self.given_up += len(self._begun)
        self._begun.clear()
        self._searched = 0
        self._discard(len(self._bytes))

    def _complete(self, messages: list[Message]) -> bool:
        """Take the first complete message; False if there is none."""
        whole = next((each for each in self._begun if each.end <= len(self._bytes)), None)
        if whole is None:
            return False
        payload = bytes(memoryview(self._bytes)[whole.at + HEADER.size : whole.end - CRC.size])
        if CRC.pack(zlib.crc32(payload)) != self._bytes[whole.end - CRC.size : whole.end]:
            self._begun.remove(whole)  # its content is searched all the same
            messages.append(whole.message)
            return True
        self.given_up += self._begun.index(whole)
        self._begun = [each for each in self._begun if each.at >= whole.end]
        self._discard(whole.at)
        size = whole.end - whole.at
        self._forget(size)
        messages.append(whole.message._replace(payload=payload))
        return True

    def _search(self, messages: list[Message]) -> bool:
        """Search the next header; False if more bytes are needed."""
        start = self._bytes.find(MAGIC, self._searched)
        if start < 0:
            # The last bytes may begin a magic.
            begun = next((n for n in (3, 2, 1) if self._bytes.endswith(MAGIC[:n])), 0)
            self._searched = max(self._searched, len(self._bytes) - begun)
            return False
        self._searched = start
        if len(self._bytes) - start < HEADER.size:
            return False
        self._searched += len(MAGIC)
        head = _header(self._bytes, start)
        if head is None:
            return True
        message, length = head
        if message.version != VERSION:
            messages.append(message)
        elif self._fits(message, length):
            self._begun.append(_Begun(start, start + HEADER.size + length + CRC.size, message))
            if len(self._begun) > MAX_BEGUN:
                del self._begun[0]
                self.given_up += 1
        return True

    def _discard(self, size: int) -> None:
        """Forget leading bytes that belong to no sound message."""
        self.discarded_bytes += size
        self._forget(size)

    def _forget(self, size: int) -> None:
        del self._bytes[:size]
        self._searched = max(self._searched - size, 0)
        self._begun = [each.moved(-size) for each in self._begun]


class _Begun(NamedTuple):
    """An incomplete message, from its header to where it would end."""

    at: int
    end: int
    message: Message

    def moved(self, size: int) -> "_Begun":
        return self._replace(at=self.at + size, end=self.end + size)


def _header(content: bytearray, at: int) -> tuple[Message, int] | None:
    """Message without payload, and the payload's length; None if there is no header."""
    _, version, kind, run, number, length, time_ns, setup, crc = HEADER.unpack_from(content, at)
    if zlib.crc32(memoryview(content)[at : at + HEADER.size - CRC.size]) != crc:
        return None
    if version == VERSION and (length > MAX_PAYLOAD_BYTES or kind not in set(Kind)):
        return None
    return Message(kind, None, number, time_ns, run, setup, version), length
