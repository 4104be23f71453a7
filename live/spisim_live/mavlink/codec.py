"""Messages from bytes and to bytes, by pymavlink."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reconstruction.base.errors import InputError

STAMP_BYTES = 8
"""Time in front of each message of a .tlog: microseconds since 1970, big endian."""
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
    reader = codec()
    with path.open("rb") as file:
        while len(stamp := file.read(STAMP_BYTES)) == STAMP_BYTES:
            message = None
            while message is None:
                content = file.read(reader.bytes_needed())
                if not content:
                    return
                message = reader.parse_char(content)
            yield int.from_bytes(stamp, "big") / 1e6, message
