"""Datasets by name, each with its unit."""

import math
import struct
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Protocol

import h5py
import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError
from .chunks import Chunks
from .strings import MAX_ATTRIBUTE_BYTES, check_attribute, check_dataset

DAMAGE = (
    OSError, RuntimeError, LookupError, TypeError, ValueError, ArithmeticError, MemoryError,
    struct.error,
)  # fmt: skip
"""Errors of h5py and NumPy on files that are damaged or not HDF5."""


@contextmanager
def undamaged() -> Iterator[None]:
    """Turn errors of a damaged file into InputError; the block may only read."""
    try:
        yield
    except (InputError, PermissionError):
        raise
    except DAMAGE as error:
        raise InputError(f"not an HDF5 file, or truncated or damaged ({error})") from error


class Dataset:
    """Numbers or texts in an open file, read on demand.

    Raises InputError, naming the dataset, for any other content, unbounded filters or damage.
    """

    def __init__(self, name: str, dataset: h5py.Dataset) -> None:
        self.name = name
        self._dataset = dataset
        with undamaged():
            shape, dtype = dataset.shape, dataset.dtype
            varies = _varies(dtype)
            self._chunks = Chunks.of(name, dataset)
        if shape is None or not (dtype.kind in "iufbS" or (varies and math.prod(shape) == 1)):
            raise InputError(f"{name} must hold numbers or a text, found {dtype}")
        if varies:
            with undamaged():
                check_dataset(name, dataset)
        if self._chunks is not None:
            self._chunks.check_filters()
        self.shape: tuple[int, ...] = tuple(shape)

    @cached_property
    def units(self) -> str:
        """The unit."""
        return text_attribute(self._dataset, "units")

    def read(self, rows: slice | None = None) -> NDArray[Any]:
        """Read all values, or some rows."""
        with undamaged():
            if self._chunks is not None:
                self._chunks.check_reading(rows)
            return np.asarray(self._dataset[()] if rows is None else self._dataset[rows])


class Readable(Protocol):
    """Values that are read on demand."""

    shape: tuple[int, ...]

    def read(self, rows: slice | None = None) -> NDArray[Any]:
        """Read all values, or some rows."""


class Tables(ABC):
    """Datasets by name, in any container.

    Raises InputError for a dataset that is missing, damaged or of another kind than requested.
    """

    def __init__(self, names: Collection[str]) -> None:
        self._names = names

    @abstractmethod
    def dataset(self, name: str, units: str) -> Readable:
        """Unread dataset; raises InputError also if its unit differs."""

    def __contains__(self, name: str) -> bool:
        """Whether a dataset of this name exists, or a group that holds any."""
        return any(path == name or path.startswith(f"{name}/") for path in self._names)

    def names_in(self, group: str) -> list[str]:
        """Names of the datasets in a group, empty if it is missing."""
        paths = (name.rpartition("/") for name in self._names)
        return [name for folder, _, name in paths if folder == group]

    def shape(self, name: str, units: str) -> tuple[int, ...]:
        """Shape of a dataset."""
        return self.dataset(name, units).shape

    def get(self, name: str, units: str, rows: slice | None = None) -> NDArray[Any]:
        """Read a dataset, or some rows."""
        return self.dataset(name, units).read(rows)

    def numbers(self, name: str, units: str = "1") -> NDArray[Any]:
        """Read a dataset of numbers."""
        values = self.get(name, units)
        if values.dtype.kind not in "iuf":
            raise InputError(f"{name} must hold numbers, found {values.dtype}")
        return values

    def number(self, name: str, units: str = "1") -> float:
        """Read a dataset of a single number."""
        self._check_single(name, units)
        return float(self.numbers(name, units).item())

    def integer(self, name: str) -> int:
        """Read a dataset of a single integer."""
        self._check_single(name, "1")
        value = self.numbers(name).item()
        if not float(value).is_integer():
            raise InputError(f"{name} is {value}, must be an integer")
        return int(value)

    def text(self, name: str) -> str:
        """Read a dataset of a single string."""
        self._check_single(name, "1")
        (text,) = self.texts(name)
        return text

    def texts(self, name: str) -> list[str]:
        """Read all strings of a dataset."""
        return [_as_text(value) for value in self.get(name, "1").flat]

    def _check_single(self, name: str, units: str) -> None:
        shape = self.shape(name, units)
        if set(shape) - {1}:
            raise InputError(f"{name} has shape {shape}, expected a scalar")


class Contents(Tables):
    """The datasets of an open file, read on demand."""

    def __init__(self, file: h5py.File, datasets: Mapping[str, h5py.Dataset]) -> None:
        super().__init__(datasets)
        self.version = (0, 0)
        self._file = file
        self._stored = datasets
        self._opened: dict[str, Dataset] = {}

    def has_attribute(self, name: str) -> bool:
        """Whether the file has an attribute."""
        with undamaged():
            return name in self._file.attrs

    def attribute(self, name: str) -> str:
        """Read an attribute of the file as text."""
        return text_attribute(self._file, name)

    def units(self, name: str) -> str:
        """The unit of a dataset."""
        return self._dataset(name).units

    def dataset(self, name: str, units: str) -> Dataset:
        """Unread dataset; raises InputError also if its unit differs."""
        dataset = self._dataset(name)
        if dataset.units != units:
            raise InputError(f"dataset {name} has units {dataset.units!r}, expected {units!r}")
        return dataset

    def _dataset(self, name: str) -> Dataset:
        if name not in self._stored:
            raise InputError(f"dataset {name} is missing")
        if name not in self._opened:
            self._opened[name] = Dataset(name, self._stored[name])
        return self._opened[name]


def _as_text(value: Any) -> str:
    """Decode what h5py returns for a string."""
    with undamaged():
        return value.decode() if isinstance(value, bytes) else str(value)


def _varies(dtype: np.dtype[Any]) -> bool:
    """Whether a type is a string of variable length."""
    string = h5py.check_string_dtype(dtype)
    return string is not None and string.length is None


def text_attribute(item: h5py.File | h5py.Dataset, name: str) -> str:
    """Read an attribute as text; raises InputError if it is missing or not text."""
    with undamaged():
        if name not in item.attrs:
            raise InputError(f"attribute {name!r} of {item.name} is missing")
        held = item.attrs.get_id(name)
        string = h5py.check_string_dtype(held.dtype) is not None
        if not string or held.get_storage_size() > MAX_ATTRIBUTE_BYTES or set(held.shape) - {1}:
            raise InputError(f"attribute {name!r} of {item.name} is not a text")
        if _varies(held.dtype):
            check_attribute(item, name)
        value = np.asarray(item.attrs[name]).item()
    return _as_text(value)
