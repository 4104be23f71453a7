"""How much memory an HDF5 file takes, known before it is read.

A file may unpack to much more than it holds: compressed data, data never written that all have a
fill value, chunks that are larger than their dataset. What it holds itself is no concern.
"""

import math
import zlib
from collections.abc import Mapping

import h5py
from h5py import h5d, h5z

from ...errors import InputError

MAX_UNPACKED_BYTES = 2**28
"""Memory for all data that a file does not hold in full, at 8 bytes a number."""
MAX_CHUNKS = 2**16
"""Chunks that are read at a time: each takes memory even where it is empty."""

FILTERS = {h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE, h5z.FILTER_FLETCHER32}
NUMBER_BYTES = 8
CHECKSUM_BYTES = 4


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


def check_reading(dataset: h5py.Dataset, rows: slice | None = None) -> None:
    """Check that a dataset, or some rows of it, can be unpacked within bounds.

    The library itself has none: a chunk of 64 KiB may inflate to any size. Raises InputError for
    that, for filters other than `FILTERS`, and beyond `MAX_CHUNKS`.
    """
    stored = dataset.id.get_create_plist()
    if stored.get_layout() != h5d.CHUNKED:
        return
    filters = _filters(stored)
    if len(set(filters)) < len(filters) or not set(filters) <= FILTERS:
        raise InputError(
            f"{_name(dataset)} is packed in a way that is not read; allowed: uncompressed, or gzip "
            "and shuffle, with Fletcher-32 or without"
        )
    chunk = stored.get_chunk()
    ranges = [range(0, size, step) for size, step in zip(dataset.shape, chunk, strict=True)]
    if rows is not None:
        ranges[0] = range(rows.start // chunk[0] * chunk[0], rows.stop, chunk[0])
    if math.prod(map(len, ranges)) > MAX_CHUNKS:
        raise InputError(
            f"{_name(dataset)} is stored in more than {MAX_CHUNKS} chunks: make them larger"
        )
    if h5z.FILTER_DEFLATE in filters:
        _check_inflation(dataset, ranges[0], _chunk_bytes(dataset), filters)


def _sizes(name: str, dataset: h5py.Dataset, file_bytes: int) -> tuple[int, int]:
    """Bytes that are stored, and that are unpacked where these are not all."""
    elements = 0 if dataset.shape is None else math.prod(dataset.shape)
    layout = dataset.id.get_create_plist()
    if layout.get_layout() == h5d.CHUNKED:
        steps = zip(dataset.shape, layout.get_chunk(), strict=True)
        in_memory = math.prod(-(-size // step) for size, step in steps) * _chunk_bytes(dataset)
        stored = _stored_in_chunks(name, dataset, file_bytes)
    else:
        in_memory = elements * dataset.id.get_type().get_size()
        stored = dataset.id.get_storage_size()
    if stored >= in_memory:
        return stored, 0
    return stored, max(in_memory, NUMBER_BYTES * elements)


def _stored_in_chunks(name: str, dataset: h5py.Dataset, file_bytes: int) -> int:
    """Bytes of all chunks of a dataset; InputError if one of them cannot be as it is told."""
    filters = _filters(dataset.id.get_create_plist())
    plain = _chunk_bytes(dataset)
    stored = 0

    def count(chunk: h5d.StoreInfo) -> bool | None:
        nonlocal stored
        stored += chunk.size
        applied = _applied(filters, chunk.filter_mask)
        expected = plain + CHECKSUM_BYTES * (h5z.FILTER_FLETCHER32 in applied)
        packed = set(applied) - {h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32}
        wrong = not packed and chunk.size != expected
        outside = chunk.byte_offset + chunk.size > file_bytes
        return wrong or outside or stored > file_bytes or None  # anything but None ends it

    if dataset.id.chunk_iter(count):
        raise InputError(f"{name} has a chunk of another size than it must have: damaged")
    return stored


def _check_inflation(
    dataset: h5py.Dataset, first_rows: range, plain: int, filters: list[int]
) -> None:
    """Inflate the chunks that begin with these rows, each no further than it may reach."""
    chunks: list[tuple[tuple[int, ...], int]] = []

    def keep(chunk: h5d.StoreInfo) -> None:
        if chunk.chunk_offset[0] in first_rows:
            chunks.append((chunk.chunk_offset, chunk.filter_mask))

    dataset.id.chunk_iter(keep)
    for offset, mask in chunks:
        applied = _applied(filters, mask)
        if h5z.FILTER_DEFLATE not in applied:
            continue
        before = applied[: applied.index(h5z.FILTER_DEFLATE)]
        expected = plain + CHECKSUM_BYTES * (h5z.FILTER_FLETCHER32 in before)
        stream = zlib.decompressobj()
        _, packed = dataset.id.read_direct_chunk(offset)
        try:
            found = len(stream.decompress(packed, expected + 1))
        except zlib.error as error:
            raise InputError(f"{_name(dataset)} is damaged ({error})") from error
        if found != expected or not stream.eof:
            raise InputError(
                f"{_name(dataset)} has a chunk that does not unpack to the {expected} bytes that "
                "it must have: damaged"
            )


def _chunk_bytes(dataset: h5py.Dataset) -> int:
    chunk = dataset.id.get_create_plist().get_chunk()
    return math.prod(chunk) * int(dataset.id.get_type().get_size())


def _filters(layout: h5py.h5p.PropDCID) -> list[int]:
    return [layout.get_filter(number)[0] for number in range(layout.get_nfilters())]


def _applied(filters: list[int], mask: int) -> list[int]:
    """The filters that a chunk has gone through: it may have left some out."""
    return [code for number, code in enumerate(filters) if not mask >> number & 1]


def _name(dataset: h5py.Dataset) -> str:
    return str(dataset.name).lstrip("/")
