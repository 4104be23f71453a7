"""NPY files, whose headers are not believed."""

import math
from collections.abc import Callable
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

_HEADERS: dict[tuple[int, int], Callable[..., tuple[tuple[int, ...], bool, np.dtype[Any]]]] = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}


class Header(NamedTuple):
    """What an NPY file tells of its array."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def numbers(self) -> int:
        """How many there are."""
        return math.prod(self.shape)


REAL, COMPLEX = "fiub", "fiubc"
"""Kinds of numbers that are wanted."""


def read_header(file: IO[bytes], kinds: str = REAL) -> Header:
    """Header of an open NPY file of numbers of these kinds; InputError for anything else."""
    start = file.tell()
    try:
        shape, _, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
    except Exception as error:  # the header is a text that NumPy parses
        raise InputError("not a readable NPY file: it has no valid header") from error
    file.seek(start)
    if dtype.kind not in kinds:
        wanted = "real numbers" if kinds == REAL else "numbers"
        raise InputError(f"should hold {wanted}; found {dtype}")
    if min(shape, default=0) < 0:
        raise InputError(f"not a readable NPY file: its header tells of the shape {shape}")
    return Header(shape, dtype)


def read_npy(file: IO[bytes], max_bytes: int, kinds: str = REAL) -> NDArray[Any]:
    """Array of numbers of these kinds from an open NPY file that can hold so many bytes.

    Raises InputError for anything else, and where the header tells of more.
    """
    header = read_header(file, kinds)
    size = header.numbers * header.dtype.itemsize
    if size > max_bytes:
        raise InputError(
            f"not a readable NPY file: its header tells of {size} bytes, where at most "
            f"{max_bytes} can be"
        )
    try:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
    except Exception as error:  # of a packed file: whatever its unpacking raises
        raise InputError(f"not a readable NPY file ({error})") from error
