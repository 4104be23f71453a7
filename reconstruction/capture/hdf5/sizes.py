"""How much memory an HDF5 file takes, known before it is read.

A file may unpack to much more than it holds: compressed data, data never written that all have a
fill value, chunks that are larger than their dataset. What it holds itself is no concern.
"""

import math
from collections.abc import Mapping

import h5py

from ...base.errors import InputError
from .chunks import Chunks

MAX_UNPACKED_BYTES = 2**28
"""Memory for all data that a file does not hold in full, at 8 bytes a number."""
NUMBER_BYTES = 8


def check_sizes(datasets: Mapping[str, h5py.Dataset], file_bytes: int) -> None:
    """Check what datasets of a file take together; InputError beyond the limits."""
    stored_bytes = unpacked_bytes = 0
    for name, dataset in datasets.items():
        stored, unpacked = _sizes(name, dataset, file_bytes)
        stored_bytes += stored
        unpacked_bytes += unpacked
        if unpacked_bytes > MAX_UNPACKED_BYTES:
            raise InputError(
                f"unpacks to {unpacked_bytes / 2**20:.0f} MiB at {name}; at most "
                f"{MAX_UNPACKED_BYTES // 2**20} MiB may be compressed or left to a fill value: "
                "store the data uncompressed"
            )
    if stored_bytes > file_bytes:
        raise InputError(f"tells of {stored_bytes} bytes of data in a file of {file_bytes}")


def _sizes(name: str, dataset: h5py.Dataset, file_bytes: int) -> tuple[int, int]:
    """Bytes that are stored, and that are unpacked where these are not all."""
    elements = 0 if dataset.shape is None else math.prod(dataset.shape)
    chunks = Chunks.of(name, dataset)
    if chunks is None:
        in_memory = elements * dataset.id.get_type().get_size()
        stored = dataset.id.get_storage_size()
    else:
        in_memory = chunks.unpacked_bytes
        stored = chunks.stored_bytes(file_bytes)
    if stored >= in_memory:
        return stored, 0
    return stored, max(in_memory, NUMBER_BYTES * elements)
