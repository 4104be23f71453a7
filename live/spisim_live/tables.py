"""Named arrays and texts as bytes, for setups, results and states of a stream."""

import math
import re
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError
from reconstruction.capture import hdf5

from .framing import MAX_PAYLOAD_BYTES

Value = NDArray[Any]
TEXT = "t1"
TYPES = {
    name: np.dtype(f"<{name}")
    for name in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8")
} | {TEXT: np.dtype("S1")}
"""Types by their two-letter codes."""
MAX_ENTRIES = 1024
MAX_AXES = 4
_NAME = re.compile(rb"[A-Za-z0-9_/.\-]{1,255}")


class Arrays(hdf5.Tables):
    """Arrays by name, read like the datasets of a file, without units."""

    def __init__(self, arrays: Mapping[str, Value]) -> None:
        super().__init__(arrays)
        self._arrays = arrays

    def dataset(self, name: str, units: str) -> "hdf5.Readable":
        """An array; raises InputError if it is missing."""
        if name not in self._arrays:
            raise InputError(f"{name} is missing")
        return _Array(self._arrays[name])


class _Array:
    def __init__(self, values: Value) -> None:
        self.shape: tuple[int, ...] = values.shape
        self._values = values

    def read(self, rows: slice | None = None) -> Value:
        return self._values if rows is None else self._values[rows]


def packed(entries: Mapping[str, Any]) -> bytes:
    """Bytes of numbers, arrays of numbers, and texts, by name."""
    return b"".join(_entry(name, value) for name, value in entries.items())


def _entry(name: str, value: Any) -> bytes:
    if isinstance(value, str):
        content, kind = value.encode(), TEXT
        shape: tuple[int, ...] = (len(content),)
    else:
        array = np.asarray(value)
        array = array.astype(np.uint8) if array.dtype.kind == "b" else array
        kind, shape = array.dtype.str[1:], array.shape
        content = array.astype(TYPES[kind]).tobytes()
    encoded = name.encode()
    head = struct.pack(f"<B{len(encoded)}s2sB", len(encoded), encoded, kind.encode(), len(shape))
    return head + struct.pack(f"<{len(shape)}I", *shape) + content


def unpacked(content: bytes) -> dict[str, Value]:
    """Arrays by name, those of numbers as views of the bytes, texts as single byte strings.

    Raises InputError for anything but such a table.
    """
    entries: dict[str, Value] = {}
    at = 0
    while at < len(content):
        try:
            name, value, at = _read(content, at)
        except struct.error:
            raise InputError(f"ends within an entry, after {len(entries)} of them") from None
        if name in entries:
            raise InputError(f"{name} comes twice")
        if len(entries) >= MAX_ENTRIES:
            raise InputError(f"more than {MAX_ENTRIES} entries")
        entries[name] = value
    return entries


def _read(content: bytes, at: int) -> tuple[str, Value, int]:
    (length,) = struct.unpack_from("<B", content, at)
    name, kind, axes = struct.unpack_from(f"<{length}s2sB", content, at + 1)
    at += 1 + length + 3
    if not _NAME.fullmatch(name):
        raise InputError(f"{name!r} is not a valid name; allowed: letters, digits and _ / . -")
    dtype = TYPES.get(kind.decode("latin-1"))
    if dtype is None:
        raise InputError(f"{name.decode()} has the type {kind!r}; allowed: {', '.join(TYPES)}")
    if axes > MAX_AXES:
        raise InputError(f"{name.decode()} has {axes} axes; at most {MAX_AXES}")
    shape = struct.unpack_from(f"<{axes}I", content, at)
    at += 4 * axes
    if math.prod(max(side, 1) for side in shape) > MAX_PAYLOAD_BYTES:
        raise InputError(f"{name.decode()} has shape {shape}; at most {MAX_PAYLOAD_BYTES} numbers")
    size = math.prod(shape) * dtype.itemsize
    if size > len(content) - at:
        raise InputError(f"{name.decode()} has {size} bytes, but {len(content) - at} are left")
    if kind == TEXT.encode():
        value = np.array(content[at : at + size])
    else:
        value = np.frombuffer(content, dtype, math.prod(shape), at).reshape(shape)
    return name.decode(), value, at + size
