"""Files with arrays of numbers: NumPy, MATLAB, HDF5 and text."""

import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, naming
from ...base.npy import COMPLEX, REAL, STRUCTURED, read_header, read_npy
from ..hdf5 import MAX_UNPACKED_BYTES, NUMBER_BYTES
from .matlab import pick, read_hdf5, read_mat
from .text import read_text


def load_array(
    path: str | Path, variable: str | None = None, *, complex_too: bool = False
) -> NDArray[Any]:
    """Load a numeric array from .npy, .npz, .mat, .h5, .hdf5, .csv, .tsv, .txt or .dat.

    Raises InputError if the file is missing, unreadable, without numbers or without the variable,
    unpacks to more than `MAX_UNPACKED_BYTES`, or holds a number that is not finite.

    Parameters
    ----------
    path : str or Path
        The file.
    variable : str, optional
        Variable of a .npz, .mat or HDF5 file with several, its field as in ``S.y``, or column of a
        text by heading or number from 0.
    complex_too : bool
        Allow complex numbers.
    """
    path = Path(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown file type; allowed: {', '.join(READERS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with naming(path):
        try:
            array = reader(path, variable, COMPLEX if complex_too else REAL)
        except InputError:
            raise
        except Exception as error:  # each format raises its own errors
            raise InputError(f"not a readable {path.suffix} file ({error})") from error
        _check_numbers(array, COMPLEX if complex_too else REAL)
    return array


def _check_numbers(array: NDArray[Any], kinds: str) -> None:
    if array.dtype.kind not in kinds:
        hint = ", not real numbers" if array.dtype.kind == "c" else ", not numbers"
        raise InputError(f"holds {array.dtype}{hint}")
    if array.size == 0:
        raise InputError("holds no numbers")
    finite = np.isfinite(array)
    if not finite.all():
        index = tuple(int(n) for n in np.unravel_index(finite.argmin(), array.shape))
        raise InputError(
            f"the value at {list(index)} is {array[index]}, must be finite (indices count from 0)"
        )


def _read_npy(path: Path, field: str | None, kinds: str) -> NDArray[Any]:
    with path.open("rb") as file:
        array = read_npy(file, os.fstat(file.fileno()).st_size, kinds + STRUCTURED)
    return _field(array, field)


def _field(array: NDArray[Any], name: str | None) -> NDArray[Any]:
    """A field of a structured array; any other array itself."""
    names = array.dtype.names
    return array if names is None else array[pick({each: each for each in names}, name)]


def _read_npz(path: Path, variable: str | None, kinds: str) -> NDArray[Any]:
    with zipfile.ZipFile(path) as archive:
        members = {member.filename.removesuffix(".npy"): member for member in archive.infolist()}
        field = None
        if variable is not None and variable not in members and "." in variable:
            variable, _, field = variable.partition(".")
        member = pick(members, variable)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{member.filename!r} is compressed in a way that NumPy does not use")
        with archive.open(member) as file:
            header = read_header(file, kinds + STRUCTURED)
            unpacked_bytes = max(NUMBER_BYTES, header.dtype.itemsize) * header.numbers
            if member.compress_type != zipfile.ZIP_STORED and unpacked_bytes > MAX_UNPACKED_BYTES:
                raise InputError(
                    f"{member.filename!r} unpacks to {unpacked_bytes / 2**20:.0f} MiB, at most "
                    f"{MAX_UNPACKED_BYTES // 2**20}: save it with numpy.savez, uncompressed"
                )
            return _field(read_npy(file, member.file_size, kinds + STRUCTURED), field)


TEXTS = (".csv", ".tsv", ".txt", ".dat")
READERS: dict[str, Callable[[Path, str | None, str], NDArray[Any]]] = {
    ".mat": lambda path, variable, _kinds: read_mat(path, variable),
    ".npy": _read_npy,
    ".npz": _read_npz,
    **dict.fromkeys((".h5", ".hdf5"), lambda path, variable, _kinds: read_hdf5(path, variable)),
    **dict.fromkeys(TEXTS, lambda path, column, _kinds: read_text(path, column)),
}
"""Readers by file extension."""
