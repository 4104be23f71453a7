"""One run at a time in a folder."""

import fcntl
import os
import platform
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from reconstruction.errors import InputError

#: What a lock file holds: nothing, or process and machine.
_CONTENT = re.compile(rb"(\d+ .*\n?)?")
_MOST_BYTES = 300


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock file that tells process and machine; the system lets go of it if that dies.

    Raises InputError where another process holds it and where something else has its name, OSError
    where it cannot be made, and where the file system has no such locks.
    """
    with _opened(path, os.O_RDWR | os.O_CREAT) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = _named(_content(file)) or "unknown"
            raise InputError(
                f"{path.parent}: process {holder} is running this data set; wait for it or end it"
            ) from None
        if not _CONTENT.fullmatch(_content(file)):
            raise InputError(f"{path} is not the lock of a data set; move it elsewhere")
        _write(file, f"{os.getpid()} {platform.node()}\n")
        try:
            yield
        finally:
            _write(file, "")


def holder(path: Path) -> str | None:
    """Process and machine that hold a lock file; None where none does, or it was killed.

    Raises InputError where something else has its name.
    """
    try:
        with _opened(path, os.O_RDONLY) as file:
            try:
                fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return _named(_content(file))
            return None
    except FileNotFoundError:
        return None


@contextmanager
def _opened(path: Path, flags: int) -> Iterator[int]:
    """Descriptor of a regular file, never of one behind a link."""
    if path.is_symlink():
        raise InputError(f"{path} is a link; a data set holds none")
    # What became a link since is an OSError; a pipe would be waited for.
    file = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
    try:
        if not stat.S_ISREG(os.fstat(file).st_mode):
            raise InputError(f"{path} is not a regular file")
        yield file
    finally:
        os.close(file)


def _content(file: int) -> bytes:
    return os.pread(file, _MOST_BYTES, 0)


def _write(file: int, text: str) -> None:
    os.ftruncate(file, 0)
    os.pwrite(file, text.encode(), 0)


def _named(content: bytes) -> str | None:
    return " on ".join(content.decode(errors="replace").split()) or None
