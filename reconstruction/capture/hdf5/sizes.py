"""Memory of an HDF5 file, computed before it is read.

Compressed data, fill values and chunks larger than their dataset may unpack to much more than the
file holds; data that the file holds in full are not limited.
"""

import math
from collections.abc import Mapping

import h5py

from ...base.errors import InputError
from .chunks import Chunks

MAX_UNPACKED_BYTES = 2**28
"""Maximum memory of data that the file does not hold in full, at 8 bytes a number."""
NUMBER_BYTES = 8


def check_sizes(datasets: Mapping[str, h5py.Dataset], file_bytes: int) -> None:
    """Check the memory of a file's datasets.

    Raises InputError if they unpack to more than `MAX_UNPACKED_BYTES`, or claim more bytes than the
    file has.
    """
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
        raise InputError(f"claims {stored_bytes} bytes of data in a file of {file_bytes}")


def _sizes(name: str, dataset: h5py.Dataset, file_bytes: int) -> tuple[int, int]:
    """Stored bytes, and unpacked bytes if the file does not hold them in full."""
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
