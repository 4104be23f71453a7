"""Folders and files that one program at a time writes."""

import fcntl
import os
import platform
import re
import stat
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import get_ident

from .errors import InputError
from .files import Output, remove_unfinished, require_file, require_folder, require_outputs

LOCK = ".lock"
"""Name of a folder's lock file. If the folder is replaced as a whole, the lock lies beside it."""

_CONTENT = re.compile(rb"(\d+ .*\n?)?")
"""Content of a lock file: nothing, or process and machine."""
_MAX_BYTES = 300
_held: set[tuple[int, Path]] = set()
"""Threads of this process, and the lock files that they hold."""


@contextmanager
def output_folder(
    folder: str | Path,
    outputs: Iterable[Output],
    inputs: Iterable[str | Path] = (),
    *,
    overwrite: bool = False,
) -> Iterator[None]:
    """Lock a folder as `locked_folder` does, ready for these outputs of a command.

    Files that a killed run left unfinished are removed. Raises InputError as `locked_folder` and
    `require_outputs`.
    """
    files = list(outputs)
    with locked_folder(folder):
        require_outputs(files, inputs, overwrite=overwrite)
        remove_unfinished(file.path for file in files)
        yield


@contextmanager
def output_files(
    outputs: Iterable[Output], inputs: Iterable[str | Path] = (), *, overwrite: bool = False
) -> Iterator[None]:
    """Lock the names of a command's files until it has written them.

    Missing folders are created; what a killed run left unfinished is removed. Raises InputError as
    `locked` and `require_outputs`.
    """
    files = list(outputs)
    for file in files:
        require_file(file.path)
    with ExitStack() as held:
        for file in files:
            held.enter_context(_existing(file.path.parent))
            held.enter_context(locked_name(file.path))
        require_outputs(files, inputs, overwrite=overwrite)
        remove_unfinished(file.path for file in files)
        yield


@contextmanager
def locked_folder(folder: str | Path) -> Iterator[None]:
    """Lock a folder for this thread, and create it if it is missing.

    Every function that writes a folder locks it; the thread may hold the lock already. A folder
    that was created and is still empty at the end is removed.

    Raises InputError as `locked`, and if the folder cannot be created or written.
    """
    folder = Path(folder)
    require_folder(folder)
    with _existing(folder), locked(folder, folder / LOCK):
        yield


@contextmanager
def locked_name(output: Path) -> Iterator[None]:
    """Lock the name of an output that is written elsewhere and renamed once it is complete."""
    with locked(output, output.with_name(f".{output.name}{LOCK}")):
        yield


@contextmanager
def locked(held: Path, lock: Path) -> Iterator[None]:
    """Hold a lock file that states process and machine; the system releases it if that dies.

    It is removed at the end, unless the thread has held it before.

    Raises InputError if another process or thread holds it, or something else has its name; OSError
    if it cannot be created, or the file system has no such locks.
    """
    key = get_ident(), lock.absolute()
    if key in _held:
        yield
        return
    file, ours = _taken(held, lock)
    _held.add(key)
    try:
        _write(file, f"{os.getpid()} {platform.node()}\n")
        yield
    finally:
        _held.discard(key)
        with suppress(OSError):
            if ours:
                lock.unlink()
            else:
                _write(file, "")
        os.close(file)


def holder(lock: Path) -> str | None:
    """Process and machine that hold a lock file; None if none does, or it was killed."""
    try:
        file = _opened(lock, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return _named(_content(file))
    finally:
        os.close(file)
    return None


@contextmanager
def _existing(folder: Path) -> Iterator[None]:
    """Create a folder if it is missing, and remove it if it is still empty at the end."""
    made = [each for each in (folder, *folder.parents) if not each.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        with suppress(OSError):
            for each in made:
                each.rmdir()


def _taken(held: Path, lock: Path) -> tuple[int, bool]:
    """Descriptor of a locked file, and whether a process like this one created it."""
    while True:
        made = not lock.exists()
        file = _opened(lock, os.O_RDWR | os.O_CREAT)
        try:
            _acquire(file, held, lock)
            if _is_at(file, lock):
                return file, made or bool(_content(file))
        except BaseException:
            os.close(file)
            raise
        os.close(file)  # its holder has removed it since


def _acquire(file: int, held: Path, lock: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        other = _named(_content(file)) or "unknown"
        raise InputError(
            f"{held}: process {other} is writing into it; wait for it or end it"
        ) from None
    if not _CONTENT.fullmatch(_content(file)):
        raise InputError(f"{lock} is not a lock of spisim; move it elsewhere")


def _opened(lock: Path, flags: int) -> int:
    """Descriptor of a regular file, not followed through a link."""
    if lock.is_symlink():
        raise InputError(f"{lock} is a link; a lock file must not be one")
    # A new link is an OSError; opening a pipe would block.
    file = os.open(lock, flags | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise InputError(f"{lock} is not a regular file")
    return file


def _is_at(file: int, lock: Path) -> bool:
    with suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(file), lock.lstat())
    return False


def _content(file: int) -> bytes:
    return os.pread(file, _MAX_BYTES, 0)


def _write(file: int, text: str) -> None:
    content = text.encode()
    os.pwrite(file, content, 0)
    os.ftruncate(file, len(content))


def _named(content: bytes) -> str | None:
    return " on ".join(content.decode(errors="replace").split()) or None
