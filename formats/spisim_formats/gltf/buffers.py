"""Numbers of a glTF file: buffers, views of them, and accessors, compressed by meshopt or not.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, section 3.6.
"""

from __future__ import annotations

import base64
import json
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.errors import InputError, LimitError
from spisim_formats.library.files import MAX_FILE_BYTES, Folders, read_bytes

COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
KINDS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class Buffers:
    """The numbers that a header (checked by `check_sizes`) refers to."""

    def __init__(self, header: dict[str, Any], path: Path, folders: Folders, chunk: bytes) -> None:
        self._header = header
        self._required = header.get("extensionsRequired", [])
        self._path, self._folders, self._chunk = path, folders, chunk
        self._data: dict[str, bytes] = {}
        self._views: dict[int, bytes | memoryview] = {}

    def accessor(self, index: Any) -> NDArray[Any]:
        """Return values (count, components) of an accessor; normalized integers become -1 to 1."""
        row = at(_rows(self._header, "accessors"), index, "accessor")
        if "bufferView" not in row and "sparse" not in row:
            raise InputError(f"accessor {index} has no bufferView: its data are not in the file")
        kind = np.dtype(KINDS[row["componentType"]])
        shape = (whole(row, "count"), COMPONENTS[row["type"]])
        values = np.zeros(shape, kind)
        if "bufferView" in row:
            values = self._strided(row, kind, shape)
        if "sparse" in row:
            values = self._with_sparse(row["sparse"], values)
        if row.get("normalized") and kind.kind in "iu":
            return np.asarray(np.maximum(values / np.iinfo(kind).max, -1.0))
        return values

    def view(self, index: Any) -> bytes | memoryview:
        """Return bytes of a buffer view. Raises InputError if it exceeds its buffer."""
        if index not in self._views:
            row = at(_rows(self._header, "bufferViews"), index, "bufferView")
            packed = [
                row["extensions"][name] for name in MESHOPT if name in row.get("extensions", {})
            ]
            needed = any(name in self._required for name in MESHOPT)
            self._views[index] = _unpacked(packed[0], self) if packed and needed else self.part(row)
        return self._views[index]

    def part(self, row: dict[str, Any]) -> memoryview:
        """Bytes from `byteOffset` of a buffer, `byteLength` long."""
        start, length = whole(row, "byteOffset", 0), whole(row, "byteLength")
        data = self._buffer(at(_rows(self._header, "buffers"), row["buffer"], "buffer"))
        if start + length > len(data):
            raise InputError(f"a bufferView ends at byte {start + length} of {len(data)}")
        return memoryview(data)[start : start + length]

    def _strided(
        self, row: dict[str, Any], kind: np.dtype[Any], shape: tuple[int, int]
    ) -> NDArray[Any]:
        view = at(_rows(self._header, "bufferViews"), row["bufferView"], "bufferView")
        stride = whole(view, "byteStride", 0) or kind.itemsize * shape[1]
        data, start = self.view(row["bufferView"]), whole(row, "byteOffset", 0)
        end = start + (shape[0] - 1) * stride + shape[1] * kind.itemsize
        if shape[0] and end > len(data):
            raise InputError(f"an accessor ends at byte {end} of a bufferView of {len(data)}")
        return np.ndarray(shape, kind, data, start, (stride, kind.itemsize)).copy()

    def _with_sparse(self, sparse: dict[str, Any], values: NDArray[Any]) -> NDArray[Any]:
        count, indices, given = whole(sparse, "count"), sparse["indices"], sparse["values"]
        numbers = np.frombuffer(
            self.view(indices["bufferView"]),
            KINDS[indices["componentType"]],
            count,
            whole(indices, "byteOffset", 0),
        )
        new = np.frombuffer(
            self.view(given["bufferView"]),
            values.dtype,
            count * values.shape[1],
            whole(given, "byteOffset", 0),
        )
        if count and not numbers.max() < len(values):
            raise InputError("a sparse accessor has indices beyond its end")
        values[numbers] = new.reshape(count, -1)
        return values

    def _buffer(self, row: dict[str, Any]) -> bytes:
        """Return the bytes of a buffer, read on first use."""
        uri = row.get("uri")
        if uri is None:
            return self._chunk
        if uri not in self._data:
            self._data[uri] = self._bytes_of(uri)
            if sum(map(len, self._data.values())) > MAX_FILE_BYTES:
                raise LimitError("its buffers hold more than 2 GB together, which are not read")
        return self._data[uri]

    def _bytes_of(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            return within(uri)
        return read_bytes(self._folders.find(unquoted(uri), self._path.parent, "buffer"))


def check_sizes(header: dict[str, Any]) -> None:
    """Raise LimitError for accessors of more than 2 GB in total; damaged ones raise when used."""
    total = 0
    for row in _rows(header, "accessors"):
        with suppress(InputError, KeyError, TypeError):
            width = np.dtype(KINDS[row["componentType"]]).itemsize * COMPONENTS[row["type"]]
            total += whole(row, "count") * width
    if total > MAX_FILE_BYTES:
        raise LimitError(
            f"its accessors hold {total / 1024**3:.3g} GB; more than 2 GB are not read"
        )


def _unpacked(packed: dict[str, Any], buffers: Buffers) -> bytes:
    """Decompress a view (EXT_meshopt_compression, https://meshoptimizer.org)."""
    decoder = library("meshoptimizer", "EXT_meshopt_compression", "meshopt")
    data = np.frombuffer(buffers.part(packed), np.uint8)
    count, stride = whole(packed, "count"), whole(packed, "byteStride")
    if count * stride > MAX_FILE_BYTES:
        raise LimitError("a compressed bufferView holds more than 2 GB, which are not read")
    if packed["mode"] != "ATTRIBUTES":
        name = "index_buffer" if packed["mode"] == "TRIANGLES" else "index_sequence"
        indices = getattr(decoder, f"decode_{name}")(count, stride, data)
        # the library writes numbers of the requested width into an array of wider ones
        return bytes(indices.tobytes()[: count * stride])
    values = decoder.decode_vertex_buffer(count, stride, data, dtype=np.dtype(f"V{stride}"))
    filtered = {"OCTAHEDRAL": "oct", "QUATERNION": "quat", "EXPONENTIAL": "exp"}.get(
        packed.get("filter", "NONE")
    )
    if filtered is not None:
        values = getattr(decoder, f"decode_filter_{filtered}")(values, count, stride)
    return bytes(np.ascontiguousarray(values).tobytes())


def library(name: str, extension: str, extra: str) -> Any:
    """Import an optional library. Raises InputError, naming what to install."""
    try:
        return import_module(name)
    except ImportError:
        raise InputError(
            f"is compressed ({extension}): install `spisim[{extra}]`, or export without"
        ) from None


def at(rows: list[Any], index: Any, what: str) -> Any:
    """Return a row of the header by its number. Raises InputError if there is none."""
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(rows):
        raise InputError(f"refers to {what} {_displayed(index)}; there are {len(rows)}")
    return rows[index]


def whole(row: dict[str, Any], name: str, default: int | None = None) -> int:
    """Return a number of the header. Raises InputError unless it is whole and at least 0."""
    value = row.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise InputError(
            f"{name} should be a whole number of at least 0; found {_displayed(value)}"
        )
    return value


def within(uri: str) -> bytes:
    """Return the content of a `data` URI. Raises ValueError if it is damaged."""
    kind, _, text = uri.partition(",")
    return base64.b64decode(text) if kind.endswith(";base64") else unquote_to_bytes(text)


def unquoted(uri: str) -> str:
    """Return a URI as a path, unless it has a scheme."""
    return uri if "://" in uri else unquote(uri)


def _rows(header: dict[str, Any], name: str) -> list[Any]:
    rows: list[Any] = header.get(name, [])
    return rows


def _displayed(value: Any) -> str:
    """Return a value as written in the file."""
    return json.dumps(value)[:80]
