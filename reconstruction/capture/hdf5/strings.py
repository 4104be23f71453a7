"""Strings of variable length, whose stored lengths are checked.

Such a string is stored as a length and an address. HDF5 allocates the stated length, up to 4 GiB,
before it looks at the data, so the length is first compared with the size of the file. Layout:
https://support.hdfgroup.org/documentation/hdf5/latest/_f_m_t3.html, IV.A.
"""

import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import h5py
from h5py import h5d, h5o

from ...base.errors import InputError

CONTINUED, ATTRIBUTE = 0x10, 0x0C
SHARED = 0x02
MAX_BLOCKS = 256
MAX_ATTRIBUTE_BYTES = 2**16


def check_dataset(name: str, dataset: h5py.Dataset) -> None:
    """Raise InputError unless the string of a dataset fits into its file."""
    if dataset.id.get_create_plist().get_layout() != h5d.CONTIGUOUS:
        raise InputError(
            f"{name} holds a string of variable length in chunks; store it contiguously"
        )
    position = dataset.id.get_offset()
    if position is not None:  # else it was never written, and is empty
        with Path(dataset.file.filename).open("rb") as file:
            _check(name, _at(file, position, 4), _size(file))


def check_attribute(item: h5py.File | h5py.Dataset, name: str) -> None:
    """Raise InputError unless the string of an attribute is short and fits into its file."""
    where = f"attribute {name!r} of {item.name}"
    base = item.file.userblock_size
    with Path(item.file.filename).open("rb") as file:
        values = [
            _value(body)
            for kind, flags, body in _messages(file, base, h5o.get_info(item.id).addr)
            if kind == ATTRIBUTE and not flags & SHARED and _name(body) == name.encode()
        ]
        if not values:
            raise InputError(f"{where} is stored in an unsupported way; make it of fixed length")
        for value in values:
            _check(where, value[:4], _size(file), MAX_ATTRIBUTE_BYTES)


def _check(where: str, length: bytes, file_bytes: int, max_bytes: int = 2**32) -> None:
    (size,) = struct.unpack("<I", length)
    if size > max_bytes:
        raise InputError(f"{where} has {size} bytes, at most {max_bytes} are allowed")
    if size > file_bytes:
        raise InputError(f"{where} claims a string of {size} bytes in a file of {file_bytes}")


def _messages(file: IO[bytes], base: int, address: int) -> Iterator[tuple[int, int, bytes]]:
    """Yield type, flags and body of the messages in an object's header."""
    head = _at(file, base + address, 12)
    if head.startswith(b"OHDR"):
        flags = head[5]
        begin = 6 + (16 if flags & 0x20 else 0) + (4 if flags & 0x10 else 0)
        width = 1 << (flags & 3)
        size = int.from_bytes(_at(file, base + address + begin, width), "little")
        layout, blocks = ("<BHB", 2 * (flags >> 2 & 1)), [(address + begin + width, size)]
        frame = (4, 4)  # signature and checksum of a further block
    else:
        layout, blocks = ("<HHB", 3), [(address + 16, struct.unpack_from("<I", head, 8)[0])]
        frame = (0, 0)
    form, skipped = layout
    for number, (begin, size) in enumerate(blocks):  # grows
        if number >= MAX_BLOCKS:
            raise InputError("has an object whose header has too many parts")
        block, position = _at(file, base + begin, min(size, _size(file))), 0
        while position + struct.calcsize(form) + skipped <= len(block):
            kind, length, flags = struct.unpack_from(form, block, position)
            position += struct.calcsize(form) + skipped
            body = block[position : position + length]
            position += length
            if kind == CONTINUED and length >= 16:
                further, extent = struct.unpack_from("<QQ", body)
                blocks.append((further + frame[0], max(0, extent - sum(frame))))
            yield kind, flags, body


def _name(attribute: bytes) -> bytes:
    version, size = attribute[0], struct.unpack_from("<H", attribute, 2)[0]
    begin = 9 if version == 3 else 8
    return attribute[begin : begin + size].partition(b"\0")[0]


def _value(attribute: bytes) -> bytes:
    version, *sizes = struct.unpack_from("<BxHHH", attribute)
    if version == 1:  # the first version pads
        sizes = [-(-size // 8) * 8 for size in sizes]
    return attribute[(9 if version == 3 else 8) + sum(sizes) :]


def _at(file: IO[bytes], position: int, size: int) -> bytes:
    file.seek(position)
    return file.read(size)


def _size(file: IO[bytes]) -> int:
    return os.fstat(file.fileno()).st_size
