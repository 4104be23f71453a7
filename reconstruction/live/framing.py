"""Messages in a stream of bytes (docs/live.md): packed, and found again among garbage."""

import struct
import zlib
from enum import IntEnum
from typing import NamedTuple

from ..errors import InputError

MAGIC = b"SPI\x1a"
VERSION = 1
HEADER = struct.Struct("<4sBBHIIQII")
"""Magic, version, kind, run, number, bytes of payload, time, setup, CRC-32 of all before it."""
CRC = struct.Struct("<I")
MAX_PAYLOAD_BYTES = 2**24
MAX_SEARCHED_BYTES = 2**16
"""Of a damaged message: a longer one is skipped whole, as searching it may take any time."""


class Kind(IntEnum):
    """What a message is."""

    SETUP = 1
    FRAME = 2
    END = 3
    RESULT = 4
    STATUS = 5
    COMMAND = 6


class Message(NamedTuple):
    """One message; its ``payload`` is None where it is damaged, or of another version.

    ``run`` tells starts of the sender apart, ``number`` counts its frames, ``time_ns`` is its
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
    """The bytes of a message. Raises InputError for one that is too long."""
    payload = message.payload or b""
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise InputError(
            f"a message of {len(payload)} bytes; at most {MAX_PAYLOAD_BYTES}: fewer pixels, or "
            "fewer readings of each frame"
        )
    told = (message.run, message.number, len(payload), message.time_ns, message.setup)
    head = HEADER.pack(MAGIC, message.version, message.kind, *told, 0)[: -CRC.size]
    return b"".join((head, CRC.pack(zlib.crc32(head)), payload, CRC.pack(zlib.crc32(payload))))


class Parser:
    """Finds messages in bytes as they come, in pieces of any size.

    Never raises, whatever the bytes, and holds no more than one message and a piece.
    ``discarded_bytes`` are those that belong to no sound message.
    """

    def __init__(self) -> None:
        self.discarded_bytes = 0
        self._bytes = bytearray()

    def feed(self, piece: bytes) -> list[Message]:
        """Messages that a piece completes, sound or not."""
        self._bytes += piece
        messages: list[Message] = []
        at = 0
        while (step := self._next(at, messages)) is not None:
            at = step
        del self._bytes[:at]
        return messages

    def reset(self) -> None:
        """Drop the beginning of a message whose end will not come."""
        self.discarded_bytes += len(self._bytes)
        self._bytes.clear()

    def _next(self, at: int, messages: list[Message]) -> int | None:
        """Where to go on after looking at one place, None where more bytes are needed."""
        found = self._bytes.find(MAGIC, at)
        if found < 0:
            found = max(at, len(self._bytes) - _beginning(self._bytes))
        self.discarded_bytes += found - at
        if len(self._bytes) - found < HEADER.size:
            return found if found > at else None
        head = _header(self._bytes, found)
        if head is None:
            return self._skip(found, len(MAGIC))
        message, length = head
        end = found + HEADER.size + length + CRC.size
        if message.version != VERSION:
            messages.append(message)
            return self._skip(found, len(MAGIC))
        if end > len(self._bytes):
            return found if found > at else None
        payload = bytes(memoryview(self._bytes)[found + HEADER.size : end - CRC.size])
        if CRC.pack(zlib.crc32(payload)) != self._bytes[end - CRC.size : end]:
            messages.append(message)
            whole = end - found
            return self._skip(found, len(MAGIC) if whole <= MAX_SEARCHED_BYTES else whole)
        messages.append(message._replace(payload=payload))
        return end

    def _skip(self, at: int, size: int) -> int:
        self.discarded_bytes += size
        return at + size


def _header(content: bytearray, at: int) -> tuple[Message, int] | None:
    """A message without its payload, whose length is told too; None where there is no header."""
    _, version, kind, run, number, length, time_ns, setup, crc = HEADER.unpack_from(content, at)
    if zlib.crc32(memoryview(content)[at : at + HEADER.size - CRC.size]) != crc:
        return None
    if version == VERSION and (length > MAX_PAYLOAD_BYTES or kind not in set(Kind)):
        return None
    return Message(kind, None, number, time_ns, run, setup, version), length


def _beginning(content: bytearray) -> int:
    """How many of the last bytes may be the beginning of a magic."""
    return next((n for n in (3, 2, 1) if content.endswith(MAGIC[:n])), 0)
