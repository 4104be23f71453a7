"""Export formats by name, and outputs that are written whole or not at all."""

import secrets
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ..base.errors import InputError, nearest
from ..base.files import Output, is_marked, require_folder, require_outputs
from ..base.folders import locked_name
from ..base.registry import Registry
from .shot import Shot

DEFAULT_EXPORT = "rgbd"
"""Format of outputs without a known extension."""
KIND = "export"
"""Kind in the marks of all exported files."""
MAX_FILES = 1_000_000
"""Maximum number of files in a folder to replace."""


def _no_requirements() -> None:
    """Check nothing."""


@dataclass(frozen=True)
class Export:
    """An export format.

    ``write`` writes shots into an empty folder or, with a ``suffix``, a new file; it raises
    InputError if they lack what the format needs. ``check`` raises InputError if a library is
    missing.
    """

    title: str
    write: Callable[[Iterable[Shot], Path], None]
    suffix: str = ""
    check: Callable[[], object] = _no_requirements


EXPORTS: Registry[Export] = Registry(
    "export format",
    package=f"{__package__}.formats",
    attribute="EXPORT",
    group="reconstruction.exports",
)


def export_format(name: str | None, output: Path) -> Export:
    """Select an export format by its name, or by the extension of the folder or file to write.

    Raises InputError if the format is unknown, or contradicts the extension.
    """
    by_suffix = {form.suffix: form for _, form in EXPORTS.loadable() if form.suffix}
    if name is not None:
        form = EXPORTS[name]
        if by_suffix.get(output.suffix.lower(), form) is not form:
            raise InputError(f"{output} has the extension of another format than --format {name}")
        return form
    if output.suffix.lower() in by_suffix:
        return by_suffix[output.suffix.lower()]
    if output.suffix and not output.is_dir():
        candidate = nearest(output.suffix, [*by_suffix, "none (a folder)"])
        raise InputError(f"{output}: unknown export extension {output.suffix!r}: {candidate}")
    return EXPORTS[DEFAULT_EXPORT]


def check_export(
    form: Export, output: Path, inputs: Iterable[Path] = (), *, overwrite: bool = False
) -> None:
    """Check that an export can be written without harming inputs or files of others.

    An earlier export may be replaced, a folder only if it holds nothing else. Raises InputError
    otherwise.
    """
    form.check()
    if form.suffix:
        require_outputs([Output(output, KIND, (form.suffix,))], inputs, overwrite=overwrite)
    else:
        check_folder(output, inputs)


def check_folder(folder: Path, inputs: Iterable[Path] = ()) -> None:
    """Raise InputError unless a folder is new, empty, or an earlier export without ``inputs``."""
    unnamed = folder.name in ("", "..")
    if unnamed or folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        raise InputError(f"{folder} is not a folder; the name of a new one is needed")
    require_folder(folder)
    for path in inputs:
        if folder.exists() and path.resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{path} is read by this command; choose a folder without it")
    for number, path in enumerate(sorted(folder.rglob("*")) if folder.exists() else ()):
        ours = path.is_dir() or (path.is_file() and is_marked(path, KIND))
        if path.is_symlink() or not ours or number > MAX_FILES:
            raise InputError(f"{path} is not part of an earlier export; choose an empty folder")


def write_export(form: Export, shots: Iterable[Shot], output: Path) -> None:
    """Write shots under a temporary name, then in place of an earlier export.

    An earlier export survives errors and interrupts. Raises InputError, as the format does and if
    there is no shot, and OSError if the output cannot be written.
    """
    with_stage(output, lambda stage: form.write(shots, stage), folder=not form.suffix)


def with_stage(output: Path, write: Callable[[Path], None], *, folder: bool) -> None:
    """Let ``write`` make a file or fill a folder under a temporary name, then rename it.

    Raises InputError if another process is writing the same output.
    """
    output = Path(output)
    stage = output.with_name(f".{output.name}.{secrets.token_hex(4)}.tmp")
    new_folders = [parent for parent in output.parents if not parent.exists()]
    output.parent.mkdir(parents=True, exist_ok=True)
    try:
        with locked_name(output):
            if folder:
                stage.mkdir()
            write(stage)
            if folder and output.exists():
                shutil.rmtree(output)
            stage.replace(output)
    except BaseException as error:
        shutil.rmtree(stage, ignore_errors=True) if folder else stage.unlink(missing_ok=True)
        with suppress(OSError):
            for parent in new_folders:
                parent.rmdir()
        if isinstance(error, OSError) and str(error.filename or stage).startswith(str(stage)):
            raise OSError(error.errno, error.strerror, str(output)) from error
        raise
