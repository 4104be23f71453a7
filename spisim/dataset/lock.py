"""One run at a time in a folder."""

from __future__ import annotations

import fcntl
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from reconstruction.errors import InputError


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Hold a lock file that tells process and machine; the system lets go of it if that dies.

    Raises InputError where another process holds it, OSError where it cannot be made.
    """
    with path.open("a+", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            file.seek(0)
            holder = file.read().split() or ["unknown"]
            where = f" on {holder[1]}" if len(holder) > 1 else ""
            raise InputError(
                f"{path.parent}: process {holder[0]}{where} is running this data set; wait for it "
                "or end it"
            ) from None
        _write(file.fileno(), f"{os.getpid()} {platform.node()}\n")
        try:
            yield
        finally:
            _write(file.fileno(), "")


def _write(descriptor: int, text: str) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, text.encode(), 0)
