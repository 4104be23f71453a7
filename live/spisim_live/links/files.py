"""Pipes and files."""

import os
import select
import sys
import time
from pathlib import Path
from typing import IO

from reconstruction.base.errors import InputError
from reconstruction.base.files import Output, begun

from ..framing import MAGIC
from .link import PIECE_BYTES, Ended, Link, Outlet, Source


class Stdin(Source):
    """Standard input."""

    patient = True

    def receive(self, timeout_s: float) -> bytes:
        descriptor = sys.stdin.fileno()
        if not select.select([descriptor], [], [], timeout_s)[0]:
            return b""
        content = os.read(descriptor, PIECE_BYTES)
        if not content:
            raise Ended
        return content


class Stdout(Outlet):
    """Standard output."""

    def send(self, content: bytes) -> None:
        sys.stdout.buffer.write(content)
        sys.stdout.buffer.flush()


class _FileLink(Link):
    """A link to a file."""

    def __init__(self, path: Path) -> None:
        super().__init__(str(path))
        self._path = path
        self._file: IO[bytes] | None = None

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None


class StreamFile(_FileLink, Source):
    """A file of messages, read to its end, or on as it grows if ``followed``."""

    patient = True

    def __init__(self, path: Path, *, followed: bool) -> None:
        super().__init__(path)
        self._followed = followed

    def check(self) -> None:
        if not self._path.exists():
            raise InputError(f"{self._path}: no such stream or capture file")
        if not self._path.is_file():
            raise InputError(
                f"{self._path} is not a regular file; a pipe is read from standard input, as -"
            )

    def open(self) -> None:
        self.close()
        self._file = self._path.open("rb", buffering=0)

    def receive(self, timeout_s: float) -> bytes:
        assert self._file is not None
        content = self._file.read(PIECE_BYTES)
        if not content and not self._followed:
            raise Ended
        if not content:
            time.sleep(timeout_s)  # files do not signal growth
        return content


class NewFile(_FileLink, Outlet):
    """A new file of messages."""

    @property
    def output(self) -> Output:
        """What it is, for `output_files`."""
        return Output(self._path, "stream", (".stream",), MAGIC.decode())

    def open(self) -> None:
        if self._file is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            with begun(self._path) as name:
                self._file = name.open("wb")

    def send(self, content: bytes) -> None:
        assert self._file is not None
        self._file.write(content)
        self._file.flush()

    def discard(self) -> None:
        """Remove what was written, if anything was."""
        if self._file is not None:
            self._path.unlink(missing_ok=True)
