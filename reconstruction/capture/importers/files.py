"""Files with arrays of numbers: NumPy's, MATLAB's and text."""

import os
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError, naming
from ...npy import read_header, read_npy
from ..hdf5 import MAX_UNPACKED_BYTES, NUMBER_BYTES
from .matlab import read_mat
from .variables import pick

MAX_CSV_BYTES = 2**28


def load_array(path: str | Path, variable: str | None = None) -> NDArray[Any]:
    """Numeric array from .npy, .csv, .npz or .mat (v5 and v7.3).

    ``variable`` names the one wanted of a .npz or .mat; not needed if there is just one. Raises
    InputError if the file is missing, unreadable or without numbers, if there is no such variable,
    if it unpacks to more than `MAX_UNPACKED_BYTES`, or if one of its numbers is not finite.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown file type; allowed: {', '.join(_READERS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with naming(path):
        try:
            array = reader(path, variable)
        except InputError:
            raise
        except Exception as error:  # each format has errors of its own
            raise InputError(f"not a readable {path.suffix} file ({error})") from error
        _check_numbers(array)
    return array


def _check_numbers(array: NDArray[Any]) -> None:
    if array.dtype.kind not in "iufb":
        raise InputError(f"holds {array.dtype}, not numbers")
    if array.size == 0:
        raise InputError("holds no numbers")
    finite = np.isfinite(array)
    if not finite.all():
        place = tuple(int(n) for n in np.unravel_index(finite.argmin(), array.shape))
        raise InputError(
            f"the value at {list(place)} is {array[place]}, must be finite (positions count from 0)"
        )


def _read_npy(path: Path, _variable: str | None) -> NDArray[Any]:
    with path.open("rb") as file:
        return read_npy(file, os.fstat(file.fileno()).st_size)


def _read_csv(path: Path, _variable: str | None) -> NDArray[Any]:
    size = path.stat().st_size
    if size > MAX_CSV_BYTES:
        raise InputError(
            f"has {size / 2**20:.0f} MiB, at most {MAX_CSV_BYTES // 2**20} of text are read: save "
            "it as .npy"
        )
    with path.open(encoding="utf-8") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an empty file is told by whoever called
        try:
            return np.loadtxt(file, delimiter=",")
        except ValueError:
            raise InputError(
                "should hold numbers with commas between them, equally many in each line"
            ) from None


def _read_npz(path: Path, variable: str | None) -> NDArray[Any]:
    with zipfile.ZipFile(path) as archive:
        members = {member.filename.removesuffix(".npy"): member for member in archive.infolist()}
        member = pick(members, variable)
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InputError(f"{member.filename!r} is packed in a way that NumPy does not use")
        with archive.open(member) as file:
            unpacked_bytes = NUMBER_BYTES * read_header(file).numbers
            if member.compress_type != zipfile.ZIP_STORED and unpacked_bytes > MAX_UNPACKED_BYTES:
                raise InputError(
                    f"{member.filename!r} unpacks to {unpacked_bytes / 2**20:.0f} MiB, at most "
                    f"{MAX_UNPACKED_BYTES // 2**20}: save it with numpy.savez, uncompressed"
                )
            return read_npy(file, member.file_size)


_READERS: dict[str, Callable[[Path, str | None], NDArray[Any]]] = {
    ".mat": read_mat,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".csv": _read_csv,
}
