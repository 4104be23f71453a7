"""What reading a damaged file runs into."""

import struct
from collections.abc import Iterator
from contextlib import contextmanager

from ...base.errors import InputError

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
