"""Chunked storage of datasets, checked before it is unpacked."""

import math
import zlib
from dataclasses import dataclass

import h5py
from h5py import h5d, h5z

from ...base.errors import InputError

MAX_CHUNKS = 2**16
"""Maximum number of chunks per read: each takes memory even if it is empty."""

FILTERS = frozenset({h5z.FILTER_SHUFFLE, h5z.FILTER_DEFLATE, h5z.FILTER_FLETCHER32})
CHECKSUM_BYTES = 4


@dataclass(frozen=True)
class Chunks:
    """Chunks of a dataset: shape, unpacked size of each, and filters."""

    name: str
    dataset: h5py.Dataset
    shape: tuple[int, ...]
    plain_bytes: int
    filters: tuple[int, ...]

    @classmethod
    def of(cls, name: str, dataset: h5py.Dataset) -> "Chunks | None":
        """Chunks of a dataset, None if it is not chunked."""
        stored = dataset.id.get_create_plist()
        if stored.get_layout() != h5d.CHUNKED:
            return None
        shape = stored.get_chunk()
        plain_bytes = math.prod(shape) * int(dataset.id.get_type().get_size())
        filters = tuple(stored.get_filter(n)[0] for n in range(stored.get_nfilters()))
        return cls(name, dataset, shape, plain_bytes, filters)

    @property
    def unpacked_bytes(self) -> int:
        """Memory of all chunks."""
        steps = zip(self.dataset.shape, self.shape, strict=True)
        return math.prod(-(-size // step) for size, step in steps) * self.plain_bytes

    def stored_bytes(self, file_bytes: int) -> int:
        """Size of all chunks in the file; raises InputError for an impossible size."""
        stored = 0

        def count(chunk: h5d.StoreInfo) -> bool | None:
            nonlocal stored
            stored += chunk.size
            applied = self._applied(chunk.filter_mask)
            packed = set(applied) - {h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32}
            wrong = not packed and chunk.size != self._bytes_after(applied)
            outside = chunk.byte_offset + chunk.size > file_bytes
            return wrong or outside or stored > file_bytes or None  # None continues

        if self.dataset.id.chunk_iter(count):
            raise InputError(f"{self.name} is damaged: a chunk has an impossible size")
        return stored

    def check_filters(self) -> None:
        """Raise InputError for filters whose work cannot be bounded."""
        if len(set(self.filters)) < len(self.filters) or not FILTERS.issuperset(self.filters):
            raise InputError(
                f"{self.name} has unsupported filters; allowed: none, or gzip and shuffle, with or "
                "without Fletcher-32"
            )

    def check_reading(self, rows: slice | None = None) -> None:
        """Check that all chunks, or those of some rows, can be unpacked within bounds.

        The library has no bounds: a chunk of 64 KiB may inflate to any size. Raises InputError
        then, and for more than `MAX_CHUNKS` chunks.
        """
        starts = [range(0, n, step) for n, step in zip(self.dataset.shape, self.shape, strict=True)]
        if rows is not None:
            step = self.shape[0]
            starts[0] = range(rows.start // step * step, rows.stop, step)
        if math.prod(map(len, starts)) > MAX_CHUNKS:
            raise InputError(
                f"{self.name} is stored in more than {MAX_CHUNKS} chunks; use larger chunks"
            )
        if h5z.FILTER_DEFLATE in self.filters:
            self._check_inflation(starts[0])

    def _check_inflation(self, first_rows: range) -> None:
        """Inflate the chunks that begin with these rows, none beyond its expected size."""
        chunks: list[tuple[tuple[int, ...], int]] = []

        def keep(chunk: h5d.StoreInfo) -> None:
            if chunk.chunk_offset[0] in first_rows:
                chunks.append((chunk.chunk_offset, chunk.filter_mask))

        self.dataset.id.chunk_iter(keep)
        for offset, mask in chunks:
            applied = self._applied(mask)
            if h5z.FILTER_DEFLATE not in applied:
                continue
            expected = self._bytes_after(applied[: applied.index(h5z.FILTER_DEFLATE)])
            stream = zlib.decompressobj()
            _, packed = self.dataset.id.read_direct_chunk(offset)
            try:
                inflated = len(stream.decompress(packed, expected + 1))
            except zlib.error as error:
                raise InputError(f"{self.name} is damaged ({error})") from error
            if inflated != expected or not stream.eof:
                raise InputError(
                    f"{self.name} is damaged: a chunk does not unpack to {expected} bytes"
                )

    def _applied(self, mask: int) -> list[int]:
        """Filters of a chunk, which may skip some."""
        return [code for number, code in enumerate(self.filters) if not mask >> number & 1]

    def _bytes_after(self, filters: list[int]) -> int:
        return self.plain_bytes + CHECKSUM_BYTES * (h5z.FILTER_FLETCHER32 in filters)
