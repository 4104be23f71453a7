"""MATLAB files: those of version 7.3 are HDF5; older ones are unpacked within bounds."""

import io
import math
import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .. import hdf5
from ..hdf5 import MAX_UNPACKED_BYTES, NUMBER_BYTES
from .variables import pick

HEADER_BYTES = 128
"""Of a file of version 5; elements follow, each a type, a size and data."""
COMPRESSED = 15

NUMBERS = frozenset(
    [f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)]
    + ["double", "single", "logical"]
)


def read_mat(path: Path, variable: str | None) -> NDArray[Any]:
    """A variable of numbers, or the only variable; InputError if it is none or too large."""
    return _read_hdf5(path, variable) if h5py.is_hdf5(path) else _read_older(path, variable)


def _read_hdf5(path: Path, variable: str | None) -> NDArray[Any]:
    with hdf5.surveyed(path) as (_, datasets):
        at_the_top = {name: dataset for name, dataset in datasets.items() if "/" not in name}
        name = pick({name: name for name in at_the_top}, variable)
        hdf5.check_sizes({name: datasets[name]}, path.stat().st_size)
        return hdf5.Dataset(name, datasets[name]).read().T  # MATLAB's columns come first


def _read_older(path: Path, variable: str | None) -> NDArray[Any]:
    import scipy.io  # slow to import

    content = path.read_bytes()
    unpacked = _inflated(content)
    kinds = {name: (shape, kind) for name, shape, kind in scipy.io.whosmat(_open(unpacked))}
    name = pick({name: name for name in kinds}, variable)
    shape, kind = kinds[name]
    if kind not in NUMBERS:
        raise InputError(f"{name} is of class {kind}, must hold numbers")
    size = NUMBER_BYTES * math.prod(shape)
    if size > len(content) + MAX_UNPACKED_BYTES:
        raise _too_large(size)
    return np.asarray(scipy.io.loadmat(_open(unpacked), variable_names=[name])[name])


def _inflated(content: bytes) -> bytes:
    """A MATLAB file with its compressed elements replaced by what is in them."""
    order = {b"IM": "<", b"MI": ">"}.get(content[126:HEADER_BYTES])
    if order is None:  # version 4, which has no compression
        return content
    parts, place, left = [content[:HEADER_BYTES]], HEADER_BYTES, MAX_UNPACKED_BYTES
    while place + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}II", content, place)
        following = place + 8 + size
        if kind == COMPRESSED:
            stream = zlib.decompressobj()
            parts.append(stream.decompress(content[place + 8 : following], left + 1))
            left -= len(parts[-1])
            if left < 0:
                raise _too_large(MAX_UNPACKED_BYTES - left)
        else:
            parts.append(content[place:following])
        place = following
    return b"".join(parts)


def _open(content: bytes) -> Any:
    """What SciPy reads like a file, though its types know only of paths."""
    return io.BytesIO(content)


def _too_large(size: int) -> InputError:
    return InputError(
        f"unpacks to {size / 2**20:.0f} MiB or more; at most {MAX_UNPACKED_BYTES // 2**20} MiB: "
        "save the variable alone, with -v7.3 -nocompression"
    )
