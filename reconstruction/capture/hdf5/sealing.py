"""SHA-256 digest at the head of an HDF5 file, which reveals any flipped bit before reading.

The head is the user block, which HDF5 skips: a line with the digest of everything after that line,
a line that names the maker of the file, and zeros.
"""

import hashlib
import mmap
from pathlib import Path

from ...base.errors import InputError
from ...base.files import mark

HEAD_BYTES = 512
"""Size of the smallest user block."""

_NAME = b"sha256 "
_LINE_BYTES = len(_NAME) + 64 + 1


def head(kind: str) -> bytes:
    """Head of a file of a kind, after its digest."""
    return f"{mark(kind)}\n".encode().ljust(HEAD_BYTES - _LINE_BYTES, b"\0")


def seal(content: bytearray | memoryview | mmap.mmap) -> None:
    """Write the digest of all that follows into the first line of a file."""
    with memoryview(content) as view:
        digest = hashlib.sha256(view[_LINE_BYTES:])
    content[:_LINE_BYTES] = _line(digest.hexdigest())


def is_sealed(path: str | Path) -> bool:
    """Whether a file has a digest; raises InputError if it is wrong."""
    with Path(path).open("rb") as file:
        line = file.read(_LINE_BYTES)
        if not line.startswith(_NAME):
            return False
        digest = hashlib.file_digest(file, "sha256")
    if line != _line(digest.hexdigest()):
        raise InputError(
            "truncated, damaged or changed since it was written: the digest in its first line does "
            "not match the content"
        )
    return True


def _line(digest: str) -> bytes:
    return _NAME + digest.encode() + b"\n"
