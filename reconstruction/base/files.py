"""Files that exist whole or not at all, and that take the place of no one else's."""

import os
import re
import secrets
import shutil
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from .errors import InputError, nearest

#: Where a file tells who made it: in its first or last bytes.
MARK_WITHIN_BYTES = 4096
#: Left free on a disk, whatever is written.
SPARE_BYTES = 4_000_000
#: Temporary names of files that are being written.
_BEGUN = re.compile(r"\.(.+)\.[0-9a-f]{8}\.tmp", re.DOTALL)


@dataclass(frozen=True)
class Output:
    """A file that a command will write.

    `kind` is what its mark tells, `suffixes` are the endings that its name may have, any where
    there are none. A format without comments has a `sign` in place of the mark: text by which an
    earlier output is known. It will take about `size_bytes`.
    """

    path: Path
    kind: str
    suffixes: Sequence[str] = ()
    sign: str = ""
    size_bytes: int = 1_000_000

    @property
    def is_ours(self) -> bool:
        """Whether the file that is there is an earlier output of the same kind."""
        return not self.path.is_symlink() and _contains(self.path, self.sign or mark(self.kind))


def mark(kind: str) -> str:
    """What a file of a kind tells of its maker, where its format has a place for comments."""
    return f"made by spisim: {kind}"


def is_marked(path: str | Path, kind: str) -> bool:
    """Whether a file says that it was made here and is of this kind."""
    return _contains(Path(path), mark(kind))


def _contains(path: Path, text: str) -> bool:
    with path.open("rb") as file:
        head = file.read(MARK_WITHIN_BYTES)
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - MARK_WITHIN_BYTES))
        return text.encode() in head + file.read()


def require_outputs(
    outputs: Iterable[Output], inputs: Iterable[str | Path] = (), *, overwrite: bool = False
) -> None:
    """See to it, before the long work begins, that a command can write its files and harms none.

    `inputs` are the files and folders that it reads, which stay as they are even where `overwrite`
    lets outputs take the place of others than earlier ones of their kind. A symbolic link is then
    replaced itself, not what it points to.

    Raises InputError for the name of something that is no file, of an input, with a wrong ending,
    of a file that is not to be overwritten, or of two outputs, and for a place that cannot be
    written into or is full.
    """
    files, read = list(outputs), [Path(path) for path in inputs]
    for output in files:
        _require_regular(output.path)
        _require_not_read(output.path, read)
        _require_suffix(output)
        _require_own(output, read, overwrite)
    named: dict[object, Output] = {}
    for output in files:
        one = named.setdefault(_identity(output.path), output)
        if one is not output:
            raise InputError(f"{one.path}: the {output.kind} and the {one.kind} need two names")
    for output in files:
        _require_place(output.path)
    _require_space(files)


def require_file(path: str | Path) -> None:
    """See to it that a file can be written, before the long work begins.

    Raises InputError if there is something else of this name (a folder, a device), or as
    `require_folder` for the folder it lies in.
    """
    _require_regular(Path(path))
    _require_place(Path(path))


def require_folder(folder: str | Path) -> None:
    """See to it that a folder can be written into, or made. Raises InputError where not."""
    _require_place(Path(folder) / "file")


def write_atomically(path: str | Path, content: bytes) -> None:
    """Write a file under a temporary name beside its own and rename it; make its folder.

    A symbolic link is replaced itself, not what it points to. Raises InputError if there is
    something of this name that is no file, or where its folder should be, and OSError if the file
    cannot be written. Then nothing is left behind, no new folder either, and an older file stays.
    """
    path = Path(path)
    _require_regular(path)
    _nearest_folder(path.parent)
    new_folders = [folder for folder in path.parents if not folder.exists()]
    temporary = _temporary(path)
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


def whole_name(path: Path) -> Path | None:
    """What a file will be called when it is whole; None unless `write_atomically` has begun it."""
    begun = _BEGUN.fullmatch(path.name)
    return path.with_name(begun[1]) if begun else None


def remove_unfinished(paths: Iterable[Path]) -> None:
    """Remove what killed processes had not finished writing of these files.

    No other process may be writing them.
    """
    wanted = set(paths)
    for folder in {path.parent for path in wanted}:
        for path in folder.iterdir() if folder.is_dir() else ():
            if whole_name(path) in wanted and path.is_file() and not path.is_symlink():
                path.unlink(missing_ok=True)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")


def _require_regular(path: Path) -> None:
    if "\0" in str(path):
        raise InputError(f"{path}: a name of a file has no such character")
    if path.is_dir():
        raise InputError(f"{path} is a folder; the name of a file is needed")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is not a regular file; the name of a file is needed")


def _require_not_read(path: Path, inputs: Iterable[Path]) -> None:
    if path.exists() and any(read.exists() and path.samefile(read) for read in inputs):
        raise InputError(f"{path} is read by this command; give its output another name")


def _require_suffix(output: Output) -> None:
    suffix, allowed = output.path.suffix, output.suffixes
    if allowed and suffix.lower() not in allowed:
        wrong = f"{suffix!r} is no ending of a" if suffix else "an ending is missing of this"
        raise InputError(f"{output.path}: {wrong} {output.kind}: {nearest(suffix, allowed)}")


def _require_own(output: Output, inputs: Iterable[Path], overwrite: bool) -> None:
    path = output.path
    if not os.path.lexists(path) or output.is_ours:
        return
    if not overwrite and path.is_symlink():
        raise InputError(
            f"{path} is a symbolic link; --overwrite replaces the link, not what it points to"
        )
    if not overwrite:
        raise InputError(
            f"{path} exists and is not an earlier {output.kind}; --overwrite replaces it"
        )
    for folder in inputs:
        if folder.is_dir() and path.resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{path} belongs to {folder}, which is read by this command")


def _same(one: Path, other: Path) -> bool:
    return _identity(one) == _identity(other)


def _identity(path: Path) -> object:
    """What names of one file or folder share, of one that is yet to be made too."""
    if path.exists():
        status = path.stat()
        return status.st_dev, status.st_ino
    return path.resolve()


def _nearest_folder(folder: Path) -> Path:
    """The folder itself, or the one in which it would be made; InputError where it cannot be."""
    existing = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not existing.is_dir():
        raise InputError(f"cannot write into {folder}: {existing} is not a folder")
    return existing


def _require_place(path: Path) -> None:
    """Try to write: what permissions say is not all there is to it."""
    existing, temporary = _nearest_folder(path.parent), _temporary(path)
    longest = os.pathconf(existing, "PC_NAME_MAX")
    if max(len(os.fsencode(part)) for part in temporary.parts) > longest:
        spare = len(os.fsencode(temporary.name)) - len(os.fsencode(path.name))
        raise InputError(f"{path}: a name of a file has at most {longest - spare} bytes")
    probe = existing / temporary.name
    try:
        probe.touch(exist_ok=False)
        probe.unlink()
    except OSError as error:
        reason = (error.strerror or "cannot be done").lower()
        raise InputError(f"cannot write into {path.parent}: {existing}: {reason}") from None


def _require_space(outputs: Iterable[Output]) -> None:
    needed: dict[int, int] = {}
    for output in outputs:
        existing = _nearest_folder(output.path.parent)
        device = existing.stat().st_dev
        needed[device] = needed.get(device, SPARE_BYTES) + output.size_bytes
        disk = shutil.disk_usage(existing)
        if disk.total and disk.free < needed[device]:
            raise InputError(
                f"{output.path}: {existing} has {disk.free / 1e6:.3g} MB left, "
                f"{needed[device] / 1e6:.3g} MB are needed"
            )
