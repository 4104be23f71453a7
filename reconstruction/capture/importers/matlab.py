"""MATLAB files: version 7.3 is HDF5; older ones are unpacked within bounds.

Field y of a structure S is the variable S.y.
"""

import io
import math
import struct
import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, nearest
from .. import hdf5
from ..hdf5 import MAX_UNPACKED_BYTES, NUMBER_BYTES

Variable = TypeVar("Variable")

HEADER_BYTES = 128
"""Header of a file of version 5; elements of type, size and data follow."""
INT8, MATRIX, COMPRESSED, OPAQUE = 1, 14, 15, 17
STRUCTURE, MAX_DEPTH, MAX_NAME_BYTES = 2, 8, 512
"""Class of structures, and how deep and with which names their fields are read."""
OBJECTS = {3: "an object", 16: "a function", OPAQUE: "an object"}
"""Classes without numbers, whose shape SciPy cannot read."""

NUMBERS = frozenset(
    [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
    + ["double", "single", "logical"]
)


def pick(variables: Mapping[str, Variable], name: str | None) -> Variable:
    """The variable of a name, or the only one; raises InputError if there is none or several."""
    names = list(variables)
    if name is None:
        if len(names) != 1:
            raise InputError(f"name one of its variables: {', '.join(names)}")
        return variables[names[0]]
    if name not in variables:
        raise InputError(f"has no variable {name!r}: {nearest(name, names)}")
    return variables[name]


def read_mat(path: Path, variable: str | None) -> NDArray[Any]:
    """Read a variable of numbers, or the only variable; raises InputError if it is not one or too
    large.

    Objects of MATLAB classes are left out, with a warning.
    """
    if h5py.is_hdf5(path):
        return read_hdf5(path, variable, ".").T  # MATLAB is column-major
    return _read_older(path, variable)


def read_hdf5(path: Path, variable: str | None, separator: str = "/") -> NDArray[Any]:
    """Read a dataset by its path, or the only one; raises InputError as `read_mat`."""
    with hdf5.surveyed(path) as (file, datasets):
        contents = hdf5.Contents(file, datasets)
        if contents.has_attribute("format") and contents.has_attribute("version"):
            raise InputError(
                f"is a file of the format {contents.attribute('format')!r}, not plain readings: a "
                "capture is reconstructed as it is"
            )
        names = {  # MATLAB keeps what cells refer to under #refs#
            name.replace("/", separator): name for name in datasets if not name.startswith("#")
        }
        name = names[_chosen(list(names), variable, separator)]
        hdf5.check_sizes({name: datasets[name]}, path.stat().st_size)
        return hdf5.Dataset(name, datasets[name]).read()


def _chosen(names: list[str], variable: str | None, separator: str = ".") -> str:
    """Name of a variable; of several without a name, the only one that is not within another."""
    outer = [name for name in names if separator not in name]
    return pick({name: name for name in (variable is None and outer) or names}, variable)


def _read_older(path: Path, variable: str | None) -> NDArray[Any]:
    import scipy.io  # slow to import

    content = path.read_bytes()
    unpacked, left_out = _inflated(content)
    if left_out:
        text = ", ".join(left_out)
        warnings.warn(f"{path.name}: left out, since it holds no numbers: {text}", stacklevel=2)
    kinds = {name: (shape, kind) for name, shape, kind in scipy.io.whosmat(_open(unpacked))}
    numbers = [name for name, (_, kind) in kinds.items() if kind in NUMBERS]
    name = _chosen((variable is None and numbers) or list(kinds), variable)
    shape, kind = kinds[name]
    if kind not in NUMBERS:
        raise InputError(f"{name} is of class {kind}, must hold numbers")
    size = NUMBER_BYTES * math.prod(shape)
    if size > len(content) + MAX_UNPACKED_BYTES:
        raise _too_large(size)
    return np.asarray(scipy.io.loadmat(_open(unpacked), variable_names=[name])[name])


def _inflated(content: bytes) -> tuple[bytes, list[str]]:
    """Inflate the compressed elements of a MATLAB file, and list the objects left out.

    Layout: MathWorks, "MAT-File Format", 2023, chapter 1.
    """
    order = {b"IM": "<", b"MI": ">"}.get(content[126:HEADER_BYTES])
    if order is None:  # version 4, which has no compression
        return content, []
    left_out = []
    parts, position, left = [content[:HEADER_BYTES]], HEADER_BYTES, MAX_UNPACKED_BYTES
    while position + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, position)
        following = position + 8 + size
        if kind == COMPRESSED:
            stream = zlib.decompressobj()
            parts.append(stream.decompress(content[position + 8 : following], left + 1))
            left -= len(parts[-1])
            if left < 0:
                raise _too_large(MAX_UNPACKED_BYTES - left)
        else:
            parts.append(content[position:following])
        if what := _object(parts[-1], order):
            left_out.append(what)
            parts.pop()
        else:
            parts += _flattened(parts.pop(), order)
        position = following
    return b"".join(parts), left_out


def _object(element: bytes, order: str) -> str | None:
    """Description of an element that holds an object, None for any other.

    A matrix begins with flags, whose lowest byte is its class, its dimensions, which objects of
    newer classes lack, and its name.
    """
    if len(element) < 32 or struct.unpack_from(f"{order}I", element)[0] != MATRIX:
        return None
    kind = struct.unpack_from(f"{order}I", element, 16)[0] & 0xFF
    if kind not in OBJECTS:
        return None
    start = 24 if kind == OPAQUE else _part(element, 24, order)[1]
    name = _part(element, start, order)[0] if start + 8 <= len(element) else b""
    return f"{OBJECTS[kind]} {name.decode(errors='replace')[:80]!r}"


def _flattened(element: bytes, order: str) -> list[bytes]:
    """Elements of a structure's fields, by the names NAME.FIELD; any other element itself."""
    if len(element) < 32 or struct.unpack_from(f"{order}I", element)[0] != MATRIX:
        return [element]
    dimensions, at = _part(element, 24, order)
    name, at = _part(element, at, order)
    is_one = math.prod(np.frombuffer(dimensions, f"{order}i4").tolist()) == 1
    kind = struct.unpack_from(f"{order}I", element, 16)[0] & 0xFF
    if kind != STRUCTURE or not is_one or name.count(b".") >= MAX_DEPTH:
        return [element]
    width, at = _part(element, at, order)
    names, at = _part(element, at, order)
    (size,) = struct.unpack(f"{order}I", width)
    if len(name) + size > MAX_NAME_BYTES:
        return [element]
    fields = []
    for start in range(0, len(names), size):
        field, at = element[at : _part(element, at, order)[1]], _part(element, at, order)[1]
        if len(field) >= 32 and not _object(field, order):
            full = name + b"." + names[start : start + size].partition(b"\0")[0]
            fields += _flattened(_renamed(field, full, order), order)
    return fields


def _renamed(element: bytes, name: bytes, order: str) -> bytes:
    """An element with another name."""
    start = _part(element, 24, order)[1]
    padded = struct.pack(f"{order}II", INT8, len(name)) + name.ljust(-(-len(name) // 8) * 8, b"\0")
    body = element[8:start] + padded + element[_part(element, start, order)[1] :]
    return struct.pack(f"{order}II", MATRIX, len(body)) + body


def _part(element: bytes, start: int, order: str) -> tuple[bytes, int]:
    """Data of a part of an element, and the offset of the next; short data lie within their tag."""
    kind, size = struct.unpack_from(f"{order}II", element, start)
    if kind >> 16:
        return element[start + 4 : start + 4 + min(kind >> 16, 4)], start + 8
    return element[start + 8 : start + 8 + size], start + 8 + -(-size // 8) * 8


def _open(content: bytes) -> Any:
    """Wrap bytes as a file; SciPy's types only allow paths."""
    return io.BytesIO(content)


def _too_large(size: int) -> InputError:
    return InputError(
        f"unpacks to {size / 2**20:.0f} MiB or more; at most {MAX_UNPACKED_BYTES // 2**20} MiB: "
        "save the variable alone, with -v7.3 -nocompression"
    )
