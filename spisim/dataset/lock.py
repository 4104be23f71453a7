"""One run at a time in a folder."""

import fcntl
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from reconstruction.errors import InputError


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock file that tells process and machine; the system lets go of it if that dies.

    Raises InputError where another process holds it, OSError where it cannot be made, and where the
    file system has no locks that end with their process.
    """
    try:
        held = FileLock(path, blocking=False, fallback_to_soft=False).acquire()
    except Timeout:
        raise InputError(
            f"{path.parent}: process {_named(path) or 'unknown'} is running this data set; wait "
            "for it or end it"
        ) from None
    with held:
        path.write_text(f"{os.getpid()} {platform.node()}\n", encoding="utf-8")
        try:
            yield
        finally:
            path.write_text("", encoding="utf-8")


def holder(path: Path) -> str | None:
    """Process and machine that hold a lock file; None where none does, or it was killed.

    filelock has no such question: it would make the file, and need leave to write it.
    """
    try:
        with path.open(encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return None
    except FileNotFoundError:
        return None
    except BlockingIOError:
        return _named(path)


def _named(path: Path) -> str | None:
    return " on ".join(path.read_text(encoding="utf-8").split()) or None
