"""Writing of datasets with units and checksums into a file with a digest."""

import io
import math
import mmap
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5d, h5p, h5s, h5t
from numpy.typing import NDArray

from .formats import Format, dotted
from .sealing import HEAD_BYTES, head, seal

COMPACT_BYTES = 2**13
"""Maximum size of datasets that lie in their header, under its checksum."""
CHUNK_BYTES = 2**16
"""Approximate size of the chunks of larger datasets, each with its own checksum."""


def content(write: Callable[[h5py.File], None], kind: str) -> bytes:
    """Bytes of a file of this kind, which ``write`` fills; equal content gives equal bytes.

    The format of HDF5 1.8 has checksums, without which the library may hang on a damaged file.
    """
    buffer = io.BytesIO()
    _fill(buffer, write)
    with buffer.getbuffer() as view:
        _finish(view, kind)
    return buffer.getvalue()


def write_in_place(path: Path, write: Callable[[h5py.File], None], kind: str) -> None:
    """Write the file of `content` without holding it in memory."""
    with path.open("w+b") as file:
        _fill(file, write)
        file.flush()
        with mmap.mmap(file.fileno(), 0) as view:
            _finish(view, kind)
        os.fsync(file.fileno())


def _fill(target: Any, write: Callable[[h5py.File], None]) -> None:
    with h5py.File(target, "w", libver=("v108", "v108"), userblock_size=HEAD_BYTES) as file:
        write(file)


def _finish(view: Any, kind: str) -> None:
    view[HEAD_BYTES - len(head(kind)) : HEAD_BYTES] = head(kind)
    seal(view)


def put(file: h5py.File, name: str, value: Any, units: str) -> None:
    """Write a dataset of numbers or a string."""
    data = np.asarray(_fixed(value) if isinstance(value, str) else value)
    if data.nbytes > COMPACT_BYTES:
        data = np.atleast_1d(data)  # only arrays have chunks
    dataset = create(file, name, data.shape, data.dtype, units)
    dataset.id.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(data).reshape(data.shape))


def create(
    file: h5py.File, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], units: str
) -> h5py.Dataset:
    """Create a dataset to be filled."""
    space = h5s.create_simple(shape) if shape else h5s.create(h5s.SCALAR)
    folder, _, last = name.rpartition("/")
    group = file.require_group(folder or "/")
    kind = h5t.py_create(dtype, logical=True)
    dataset = h5py.Dataset(
        h5d.create(group.id, last.encode(), kind, space, _layout(shape, dtype.itemsize))
    )
    put_attribute(dataset, "units", units)
    return dataset


def put_format(file: h5py.File, form: Format) -> None:
    """Write format name and version."""
    put_attribute(file, "format", form.name)
    put_attribute(file, "version", dotted(form.version))


def put_attribute(item: h5py.File | h5py.Dataset, name: str, text: str) -> None:
    """Write text as an attribute."""
    item.attrs[name] = _fixed(text)


def _layout(shape: tuple[int, ...], item_bytes: int) -> h5p.PropDCID:
    """Storage layout with checksums; chunks are about equally full."""
    layout = h5p.create(h5p.DATASET_CREATE)
    layout.set_obj_track_times(False)  # times would make equal files differ
    if (whole_bytes := math.prod(shape) * item_bytes) <= COMPACT_BYTES:
        layout.set_layout(h5d.COMPACT)
    else:
        rows = shape[0]
        maximum = max(1, CHUNK_BYTES * rows // whole_bytes)
        layout.set_chunk((-(-rows // -(-rows // maximum)), *shape[1:]))
        layout.set_fletcher32()
    return layout


def _fixed(text: str) -> NDArray[np.bytes_]:
    """Encode a string at fixed length, as variable ones lie in a heap without a checksum."""
    encoded = text.encode()
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", max(1, len(encoded))))
