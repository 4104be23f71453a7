"""Datasets by name, each with its unit."""

from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from .damage import undamaged
from .sizes import check_reading

MAX_ATTRIBUTE_BYTES = 2**16


class Contents:
    """The datasets of an open file, read when they are asked for.

    Raises InputError for one that is missing, damaged or not what is asked for.
    """

    def __init__(self, file: h5py.File, datasets: dict[str, h5py.Dataset]) -> None:
        self.version = (0, 0)
        self._file = file
        self._datasets = datasets
        self._units: dict[str, str] = {}

    def __contains__(self, name: str) -> bool:
        """Whether there is a dataset of this name, or a group of it that holds any."""
        return any(path == name or path.startswith(f"{name}/") for path in self._datasets)

    def names_in(self, group: str) -> list[str]:
        """Names of the datasets in a group, none if it is missing."""
        paths = (name.rpartition("/") for name in self._datasets)
        return [name for folder, _, name in paths if folder == group]

    def has_attribute(self, name: str) -> bool:
        """Whether the file has an attribute."""
        with undamaged():
            return name in self._file.attrs

    def attribute(self, name: str) -> str:
        """An attribute of the file as text."""
        return _attribute(self._file, name)

    def units(self, name: str) -> str:
        """The unit of a dataset."""
        if name not in self._datasets:
            raise InputError(f"dataset {name} is missing")
        if name not in self._units:
            self._units[name] = _attribute(self._datasets[name], "units")
        return self._units[name]

    def dataset(self, name: str, units: str) -> h5py.Dataset:
        """A dataset that is not read yet; InputError too if its unit is another."""
        found = self.units(name)
        if found != units:
            raise InputError(f"dataset {name} has units {found!r}, expected {units!r}")
        dataset = self._datasets[name]
        _check_type(name, dataset)
        return dataset

    def shape(self, name: str, units: str) -> tuple[int, ...]:
        """Shape of a dataset."""
        return tuple(self.dataset(name, units).shape)

    def get(self, name: str, units: str, rows: slice | None = None) -> NDArray[Any]:
        """A dataset, or some rows of it."""
        return read(self.dataset(name, units), rows)

    def numbers(self, name: str, units: str = "1") -> NDArray[Any]:
        """A dataset of numbers."""
        values = self.get(name, units)
        if values.dtype.kind not in "iufb":
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


def read(dataset: h5py.Dataset, rows: slice | None = None) -> NDArray[Any]:
    """What a dataset holds, or some rows of it."""
    with undamaged():
        check_reading(dataset, rows)
        return np.asarray(dataset[()] if rows is None else dataset[rows])


def _as_text(value: Any) -> str:
    """Text of what the library gives for a string."""
    with undamaged():
        return value.decode() if isinstance(value, bytes) else str(value)


def _check_type(name: str, dataset: h5py.Dataset) -> None:
    """Numbers, strings of fixed length, and one of variable length are read."""
    with undamaged():
        shape, dtype = dataset.shape, dataset.dtype
        one_string = h5py.check_string_dtype(dtype) is not None and dataset.size == 1
    if shape is None or not (dtype.kind in "iufbS" or one_string):
        raise InputError(f"{name} must hold numbers or a text, found {dtype}")


def _attribute(item: h5py.File | h5py.Dataset, name: str) -> str:
    with undamaged():
        if name not in item.attrs:
            raise InputError(f"attribute {name!r} of {item.name} is missing")
        held = item.attrs.get_id(name)
        string = h5py.check_string_dtype(held.dtype) is not None
        if not string or held.get_storage_size() > MAX_ATTRIBUTE_BYTES or set(held.shape) - {1}:
            raise InputError(f"attribute {name!r} of {item.name} is not a text")
        value = np.asarray(item.attrs[name]).item()
    return _as_text(value)
