"""HDF5 files that say what they are: a format name, a unit with every dataset."""

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .errors import InputError, naming

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

    Raises InputError naming the file: if its format is another, and for whatever goes wrong within.
    """
    with naming(path):
        try:
            with h5py.File(path, "r") as file:
                _check_format(file, form, kind)
                yield file
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


def get(file: h5py.File, name: str, units: str) -> NDArray[Any]:
    """Read a dataset; InputError if it is missing or its unit is another."""
    found = get_units(file, name)
    if found != units:
        raise InputError(f"dataset {name} has units {found!r}, expected {units!r}")
    return np.asarray(file[name][()])


def get_units(file: h5py.File, name: str) -> str:
    """Read the unit of a dataset; InputError if either is missing."""
    dataset = file.get(name)
    if not isinstance(dataset, h5py.Dataset):
        raise InputError(f"dataset {name} is missing")
    return str(get_attribute(dataset, "units"))


def get_text(file: h5py.File, name: str) -> str:
    """Read a dataset that holds one string."""
    return _text(get(file, name, "1").item())


def get_attribute(item: h5py.File | h5py.Dataset, name: str) -> Any:
    """Read an attribute as text; InputError if it is missing."""
    if name not in item.attrs:
        raise InputError(f"attribute {name!r} of {item.name} is missing")
    return _text(item.attrs[name])


def _check_format(file: h5py.File, form: str, kind: str) -> None:
    found = file.attrs.get("format")
    if found is None:
        raise InputError(f"an HDF5 file, but not a {kind} (attribute 'format' is missing)")
    if _text(found) != form:
        raise InputError(
            f"an HDF5 file, but not a {kind} (attribute 'format' is {_text(found)!r}, not {form!r})"
        )


def _fixed(text: str) -> NDArray[np.bytes_]:
    """A string of fixed length: others lie in a heap without a checksum."""
    encoded = text.encode()
    return np.array(encoded, dtype=h5py.string_dtype("utf-8", max(1, len(encoded))))


def _text(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)
