"""Atomic file output that never overwrites other files."""

import os
import re
import secrets
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from .errors import InputError, nearest

#: Bytes at either end of a file in which its mark is searched.
MARK_WITHIN_BYTES = 4096
#: Space that is left free on a disk.
SPARE_BYTES = 4_000_000
#: Name of files that only show whether a folder can be written, before `.`, digits and `.tmp`.
PROBE = "probe"
#: Temporary names of files being written.
_BEGUN = re.compile(r"\.(.+)\.[0-9a-f]{8}\.tmp", re.DOTALL)


@dataclass(frozen=True)
class Output:
    """File that a command will write.

    `kind` is stated in its mark, `suffixes` are the allowed endings, any if empty. A format without
    comments has a `sign` in place of the mark: text that identifies an earlier output. The file
    will take about `size_bytes`.
    """

    path: Path
    kind: str
    suffixes: Sequence[str] = ()
    sign: str = ""
    size_bytes: int = 1_000_000

    @property
    def is_ours(self) -> bool:
        """Whether the existing file is an earlier output of the same kind."""
        return not self.path.is_symlink() and _contains(self.path, self.sign or mark(self.kind))


def mark(kind: str) -> str:
    """Comment that identifies a file of this kind as made by spisim."""
    return f"made by spisim: {kind}"


def is_marked(path: str | Path, kind: str) -> bool:
    """Whether a file has the mark of this kind."""
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
    """Check that a command can write its files without harm, before the long work begins.

    `inputs` are the files and folders that it reads, which are never overwritten. `overwrite`
    allows outputs to replace other files than earlier ones of their kind. A symbolic link is
    replaced itself, not its target.

    Raises InputError if an output is not a regular file, is an input, has a wrong ending, would
    overwrite a file or another output, or if its folder cannot be written or is full.
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
        _require_folder(output.path)
    _require_space(files)


def require_file(path: str | Path) -> None:
    """Check that a file can be written, before the long work begins.

    Raises InputError if the name is taken by a folder or device, or as `require_folder`.
    """
    _require_regular(Path(path))
    _require_folder(Path(path))


def require_folder(folder: str | Path) -> None:
    """Check that a folder can be written or created; raises InputError if not."""
    _require_folder(Path(folder) / "file")


def write_atomically(path: str | Path, content: bytes) -> None:
    """Write a file under a temporary name beside its own and rename it; create its folder.

    A symbolic link is replaced itself, not its target. Raises InputError if the name is taken by
    something other than a file, or its folder's name by something other than a folder, and OSError
    if writing fails. In that case an older file stays, and no new file or folder does.
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
        if isinstance(error, OSError):  # name the file, not its temporary one
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


@contextmanager
def begun(path: Path) -> Iterator[Path]:
    """Temporary name of a file that grows, until its first bytes show what it is.

    An earlier file of its name is replaced, not written into, as it may have other names.
    """
    temporary = _temporary(path)
    try:
        yield temporary
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def whole_name(path: Path) -> Path | None:
    """Final name of a file by its temporary one; None for other files."""
    begun = _BEGUN.fullmatch(path.name)
    return path.with_name(begun[1]) if begun else None


def remove_unfinished(paths: Iterable[Path]) -> None:
    """Remove what killed processes left unfinished of these files; no other may be writing them."""
    wanted = set(paths)
    folders = {path.parent for path in wanted}
    wanted |= {folder / PROBE for folder in folders}
    for folder in folders:
        for path in folder.iterdir() if folder.is_dir() else ():
            if whole_name(path) in wanted and path.is_file() and not path.is_symlink():
                path.unlink(missing_ok=True)


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")


def _require_regular(path: Path) -> None:
    if "\0" in str(path):
        raise InputError(f"{path}: a file name must not contain a null character")
    if path.is_dir():
        raise InputError(f"{path} is a folder; a file name is needed")
    if path.exists() and not path.is_file():
        raise InputError(f"{path} is not a regular file; a file name is needed")


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


def _identity(path: Path) -> object:
    """Key shared by all names of a file or folder, even before it exists."""
    if path.exists():
        status = path.stat()
        return status.st_dev, status.st_ino
    return path.resolve()


def _nearest_folder(folder: Path) -> Path:
    """The folder, or its nearest existing parent; InputError if that is not a folder."""
    existing = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if not existing.is_dir():
        raise InputError(f"cannot write into {folder}: {existing} is not a folder")
    return existing


def _require_folder(path: Path) -> None:
    """Try to write, as permissions alone do not decide."""
    existing, temporary = _nearest_folder(path.parent), _temporary(path)
    longest = os.pathconf(existing, "PC_NAME_MAX")
    if max(len(os.fsencode(part)) for part in temporary.parts) > longest:
        spare = len(os.fsencode(temporary.name)) - len(os.fsencode(path.name))
        raise InputError(f"{path}: a file name has at most {longest - spare} bytes")
    probe = _temporary(existing / PROBE)
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
