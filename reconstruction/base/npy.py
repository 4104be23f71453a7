"""NPY files from untrusted sources."""

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
    """Shape and type stated by an NPY file."""

    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    @property
    def numbers(self) -> int:
        """Number of entries."""
        return math.prod(self.shape)


REAL, COMPLEX, STRUCTURED = "fiub", "fiubc", "V"
"""Accepted kinds of numbers; with ``STRUCTURED``, records with fields too."""


def read_header(file: IO[bytes], kinds: str = REAL) -> Header:
    """Header of an open NPY file of these kinds of numbers; InputError for anything else."""
    start = file.tell()
    try:
        shape, _, dtype = _HEADERS[np.lib.format.read_magic(file)](file)
    except Exception as error:  # NumPy parses the header as text
        raise InputError("not a readable NPY file: it has no valid header") from error
    file.seek(start)
    if dtype.kind not in kinds or (dtype.kind in STRUCTURED and dtype.names is None):
        wanted = "real numbers" if COMPLEX[-1] not in kinds else "numbers"
        raise InputError(f"must contain {wanted}, got {dtype}")
    if min(shape, default=0) < 0:
        raise InputError(f"not a readable NPY file: its header states the shape {shape}")
    return Header(shape, dtype)


def read_npy(file: IO[bytes], max_bytes: int, kinds: str = REAL) -> NDArray[Any]:
    """Array from an open NPY file of these kinds of numbers; InputError for anything else."""
    header = read_header(file, kinds)
    size = header.numbers * header.dtype.itemsize
    if size > max_bytes:
        raise InputError(
            f"not a readable NPY file: its header states {size} bytes of at most {max_bytes}"
        )
    try:
        return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
    except Exception as error:  # whatever unpacking raises
        raise InputError(f"not a readable NPY file ({error})") from error
