"""Messages from bytes and to bytes, by pymavlink."""

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError

STAMP_BYTES = 8
"""Time in front of each message of a .tlog: microseconds since 1970, big endian."""
VERSION_2 = 0xFD
OVERHEAD_BYTES = {0xFE: 8, VERSION_2: 12}
"""Header and checksum of a message, by its first byte."""
SIGNED, SIGNATURE_BYTES = 0x01, 13
SYSTEM, COMPONENT = 1, 196
"""Sender: MAV_COMP_ID_OBSTACLE_AVOIDANCE of the first vehicle."""


def dialect() -> Any:
    """Return the module of the common messages, version 2; InputError without pymavlink."""
    try:
        from pymavlink.dialects.v20 import common
    except ModuleNotFoundError:
        raise InputError(
            "MAVLink needs pymavlink: pip install './reconstruction[mavlink]' or 'spisim[mavlink]'"
        ) from None
    return common


def codec() -> Any:
    """Return a codec that skips what is damaged."""
    module = dialect()
    codec = module.MAVLink(None, srcSystem=SYSTEM, srcComponent=COMPONENT)
    codec.robust_parsing = True
    return codec


def logged(path: Path) -> Iterator[tuple[float, Any]]:
    """Messages of a .tlog with the time, in seconds since 1970, at which each was received."""
    content, reader, at = path.read_bytes(), codec(), 0
    while (begin := at + STAMP_BYTES) < len(content):
        end = begin + _length(content[begin : begin + 3])
        message = _decoded(reader, content[begin:end])
        if message is None:  # damage: the next message is found
            at += 1
            continue
        yield int.from_bytes(content[at:begin], "big") / 1e6, message
        at = end


def _length(header: bytes) -> int:
    """Bytes of a message of version 1 or 2 that begins with these; 0 if none does."""
    if len(header) < 3 or header[0] not in OVERHEAD_BYTES:
        return 0
    signed = header[0] == VERSION_2 and header[2] & SIGNED
    return OVERHEAD_BYTES[header[0]] + header[1] + (SIGNATURE_BYTES if signed else 0)


def _decoded(reader: Any, content: bytes) -> Any:
    """A message, None if its checksum is wrong."""
    try:
        return reader.decode(bytearray(content)) if content else None
    except (dialect().MAVError, struct.error):
        return None
