"""Files that exist whole or not at all."""

import os
import secrets
from contextlib import suppress
from pathlib import Path

from .errors import InputError

#: Where a file tells who made it: in its first or last bytes.
MARK_WITHIN_BYTES = 4096


def mark(kind: str) -> str:
    """What a file of a kind tells of its maker, where its format has a place for comments."""
    return f"made by spisim: {kind}"


def is_marked(path: str | Path, kind: str) -> bool:
    """Whether a file says that it was made here and is of this kind."""
    with Path(path).open("rb") as file:
        head = file.read(MARK_WITHIN_BYTES)
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - MARK_WITHIN_BYTES))
        return mark(kind).encode() in head + file.read()


def require_file(path: str | Path) -> None:
    """See to it that a file can be written, before the long work begins.

    Raises InputError if there is something else of this name (a folder, a device), or as
    `require_folder` for the folder it lies in.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path} is a folder; the name of a file is needed")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is not a regular file; the name of a file is needed")
    require_folder(path.parent)


def require_folder(folder: str | Path) -> None:
    """See to it that a folder can be written into, or made. Raises InputError where not."""
    folder = Path(folder)
    place = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not place.is_dir():
        raise InputError(f"cannot write into {folder}: {place} is not a folder")
    if not os.access(place, os.W_OK | os.X_OK):
        raise InputError(f"cannot write into {folder}: no permission to change {place}")


def write_atomically(path: str | Path, content: bytes) -> None:
    """Write a file under a temporary name beside its own and rename it; make its folder.

    Raises InputError as `require_file`, OSError if the file cannot be written. Then nothing is
    left behind, no new folder either, and an older file stays.
    """
    path = Path(path)
    require_file(path)
    new_folders = [folder for folder in path.parents if not folder.exists()]
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
            for folder in new_folders:
                folder.rmdir()
        if isinstance(error, OSError):  # tell of the file, not of its temporary name
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
