"""HDF5 files that say what they are: a format name, a unit with every dataset."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, naming

DAMAGE = (OSError, RuntimeError, LookupError, TypeError, ValueError, ArithmeticError, MemoryError)
"""What h5py and NumPy raise on files that are not HDF5 or no longer what was written."""


def content(write: Callable[[h5py.File], None]) -> bytes:
    """The bytes of a file that ``write`` fills; equal content gives equal bytes.

    The format of HDF5 1.8 has checksums, without which the library may not return from a damaged
    file.
    """
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("v108", "v108")) as file:
        write(file)
    return buffer.getvalue()


@contextmanager
def opened(path: str | Path, form: str, kind: str) -> Iterator[h5py.File]:
    """Open a file whose root attribute ``format`` must be ``form``; messages call it a ``kind``.

    Raises InputError naming the file: if its format is another, and as the readers below do.
    """
    with naming(path):
        with _undamaged():
            file = h5py.File(path, "r")
        try:
            _check_format(file, form, kind)
            yield file
        finally:
            with _undamaged():
                file.close()


@contextmanager
def _undamaged() -> Iterator[None]:
    """Tell what the library makes of a damaged file. Nothing but reading may stand within."""
    try:
        yield
    except (InputError, PermissionError):
        raise
    except DAMAGE as error:
        raise InputError(f"not an HDF5 file, or truncated or damaged ({error})") from error


def put(file: h5py.File, name: str, value: Any, units: str) -> None:
    """Write a dataset: numbers, or a string."""
    data = _fixed(value) if isinstance(value, str) else value
    dataset = file.create_dataset(name, data=data, track_times=False)
    put_attribute(dataset, "units", units)


def put_attribute(item: h5py.File | h5py.Dataset, name: str, text: str) -> None:
    """Write text as an attribute."""
    item.attrs[name] = _fixed(text)


def has(file: h5py.File, name: str) -> bool:
    """Whether there is a dataset or a group of this name."""
    with _undamaged():
        return name in file


def names_in(file: h5py.File, group: str) -> list[str]:
    """Names of what lies in a group, none if it is missing."""
    with _undamaged():
        return [str(name) for name in file[group]] if group in file else []


def get_shape(file: h5py.File, name: str, units: str) -> tuple[int, ...]:
    """Shape of a dataset; InputError as `get`."""
    return tuple(dataset(file, name, units).shape)


def get(file: h5py.File, name: str, units: str, rows: slice | None = None) -> NDArray[Any]:
    """Read a dataset, or some rows; InputError if it is missing or its unit is another."""
    return read(dataset(file, name, units), rows)


def read(dataset: h5py.Dataset, rows: slice | None = None) -> NDArray[Any]:
    """What a dataset holds, or some rows of it."""
    with _undamaged():
        return np.asarray(dataset[()] if rows is None else dataset[rows])


def get_numbers(file: h5py.File, name: str, units: str = "1") -> NDArray[Any]:
    """Read a dataset of numbers; InputError as `get`, and if they are none."""
    values = get(file, name, units)
    if values.dtype.kind not in "iufb":
        raise InputError(f"{name} must hold numbers, found {values.dtype}")
    return values


def get_number(file: h5py.File, name: str, units: str = "1") -> float:
    """Read a dataset that holds a single number; InputError as `get_numbers`."""
    return float(_single(name, get_numbers(file, name, units)))


def get_integer(file: h5py.File, name: str) -> int:
    """Read a dataset that holds a single integer; InputError as `get_numbers`."""
    value = _single(name, get_numbers(file, name))
    if not float(value).is_integer():
        raise InputError(f"{name} is {value}, must be an integer")
    return int(value)


def get_text(file: h5py.File, name: str) -> str:
    """Read a dataset that holds one string."""
    return as_text(_single(name, get(file, name, "1")))


def get_units(file: h5py.File, name: str) -> str:
    """Read the unit of a dataset; InputError if either is missing."""
    with _undamaged():
        dataset = file.get(name)
    if not isinstance(dataset, h5py.Dataset):
        raise InputError(f"dataset {name} is missing")
    return get_attribute(dataset, "units")


def get_attribute(item: h5py.File | h5py.Dataset, name: str) -> Any:
    """Read an attribute as text; InputError if it is missing."""
    with _undamaged():
        if name not in item.attrs:
            raise InputError(f"attribute {name!r} of {item.name} is missing")
        value = item.attrs[name]
    return as_text(value)


def _single(name: str, values: NDArray[Any]) -> Any:
    if values.size != 1:
        raise InputError(f"{name} has shape {values.shape}, expected a scalar")
    return values.item()


def dataset(file: h5py.File, name: str, units: str) -> h5py.Dataset:
    """A dataset that is not read yet; InputError if it is missing or its unit is another."""
    found = get_units(file, name)
    if found != units:
        raise InputError(f"dataset {name} has units {found!r}, expected {units!r}")
    with _undamaged():
        return file[name]


def _check_format(file: h5py.File, form: str, kind: str) -> None:
    with _undamaged():
        found = file.attrs.get("format")
    if found is None:
        raise InputError(f"an HDF5 file, but not a {kind} (attribute 'format' is missing)")
    text = as_text(found)
    if text != form:
        raise InputError(
            f"an HDF5 file, but not a {kind} (attribute 'format' is {text!r}, not {form!r})"
        )


def _fixed(text: str) -> NDArray[np.bytes_]:
    """A string of fixed length: others lie in a heap without a checksum."""
    encoded = text.encode()
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", max(1, len(encoded))))


def as_text(value: Any) -> str:
    """Text of what the library gives for a string."""
    with _undamaged():
        return value.decode() if isinstance(value, bytes) else str(value)
