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
from .strings import check_attribute, check_dataset

MAX_ATTRIBUTE_BYTES = 2**16

DAMAGE = (
    OSError, RuntimeError, LookupError, TypeError, ValueError, ArithmeticError, MemoryError,
    struct.error,
)  # fmt: skip
"""What h5py and NumPy raise on files that are not HDF5 or no longer what was written."""


@contextmanager
def undamaged() -> Iterator[None]:
    """Tell what the library makes of a damaged file. Nothing but reading may stand within."""
    try:
        yield
    except (InputError, PermissionError):
        raise
    except DAMAGE as error:
        raise InputError(f"not an HDF5 file, or truncated or damaged ({error})") from error


class Dataset:
    """Numbers or texts in an open file, read when they are asked for.

    Raises InputError, naming it, for anything else, for what is packed in a way that cannot be
    bounded, and for damage.
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
        """All values, or some rows of them."""
        with undamaged():
            if self._chunks is not None:
                self._chunks.check_reading(rows)
            return np.asarray(self._dataset[()] if rows is None else self._dataset[rows])


class Readable(Protocol):
    """Values that are read when they are asked for."""

    shape: tuple[int, ...]

    def read(self, rows: slice | None = None) -> NDArray[Any]:
        """All values, or some rows of them."""


class Tables(ABC):
    """Datasets by name, whatever holds them.

    Raises InputError for one that is missing, damaged or not what is asked for.
    """

    def __init__(self, result: Collection[str]) -> None:
        self._names = result

    @abstractmethod
    def dataset(self, name: str, units: str) -> Readable:
        """A dataset that is not read yet; InputError too if its unit is another."""

    def __contains__(self, name: str) -> bool:
        """Whether there is a dataset of this name, or a group of it that holds any."""
        return any(path == name or path.startswith(f"{name}/") for path in self._names)

    def names_in(self, group: str) -> list[str]:
        """Names of the datasets in a group, none if it is missing."""
        paths = (name.rpartition("/") for name in self._names)
        return [name for folder, _, name in paths if folder == group]

    def shape(self, name: str, units: str) -> tuple[int, ...]:
        """Shape of a dataset."""
        return self.dataset(name, units).shape

    def get(self, name: str, units: str, rows: slice | None = None) -> NDArray[Any]:
        """A dataset, or some rows of it."""
        return self.dataset(name, units).read(rows)

    def numbers(self, name: str, units: str = "1") -> NDArray[Any]:
        """A dataset of numbers."""
        values = self.get(name, units)
        if values.dtype.kind not in "iuf":
            raise InputError(f"{name} must hold numbers, found {values.dtype}")
        return values

    def number(self, name: str, units: str = "1") -> float:
        """A dataset that holds a single number."""
        self._check_single(name, units)
        return float(self.numbers(name, units).item())

    def integer(self, name: str) -> int:
        """A dataset that holds a single integer."""
        self._check_single(name, "1")
        value = self.numbers(name).item()
        if not float(value).is_integer():
            raise InputError(f"{name} is {value}, must be an integer")
        return int(value)

    def text(self, name: str) -> str:
        """A dataset that holds one string."""
        self._check_single(name, "1")
        (text,) = self.texts(name)
        return text

    def texts(self, name: str) -> list[str]:
        """All strings of a dataset."""
        return [_as_text(value) for value in self.get(name, "1").flat]

    def _check_single(self, name: str, units: str) -> None:
        shape = self.shape(name, units)
        if set(shape) - {1}:
            raise InputError(f"{name} has shape {shape}, expected a scalar")


class Contents(Tables):
    """The datasets of an open file, read when they are asked for."""

    def __init__(self, file: h5py.File, datasets: Mapping[str, h5py.Dataset]) -> None:
        super().__init__(datasets)
        self.version = (0, 0)
        self._file = file
        self._result = datasets
        self._datasets: dict[str, Dataset] = {}

    def has_attribute(self, name: str) -> bool:
        """Whether the file has an attribute."""
        with undamaged():
            return name in self._file.attrs

    def attribute(self, name: str) -> str:
        """An attribute of the file as text."""
        return text_attribute(self._file, name)

    def units(self, name: str) -> str:
        """The unit of a dataset."""
        return self._dataset(name).units

    def dataset(self, name: str, units: str) -> Dataset:
        """A dataset that is not read yet; InputError too if its unit is another."""
        dataset = self._dataset(name)
        if dataset.units != units:
            raise InputError(f"dataset {name} has units {dataset.units!r}, expected {units!r}")
        return dataset

    def _dataset(self, name: str) -> Dataset:
        if name not in self._result:
            raise InputError(f"dataset {name} is missing")
        if name not in self._datasets:
            self._datasets[name] = Dataset(name, self._result[name])
        return self._datasets[name]


def _as_text(value: Any) -> str:
    """Text of what the library gives for a string."""
    with undamaged():
        return value.decode() if isinstance(value, bytes) else str(value)


def _varies(dtype: np.dtype[Any]) -> bool:
    """Whether this is a string of variable length."""
    string = h5py.check_string_dtype(dtype)
    return string is not None and string.length is None


def text_attribute(item: h5py.File | h5py.Dataset, name: str) -> str:
    """An attribute as text; InputError if it is missing or none."""
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
