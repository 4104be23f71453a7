"""Packages of OpenUSD (.usdz): stored archives, checked before the library opens them.

https://openusd.org/release/spec_usdz.html: files are neither compressed nor encrypted, so the
content is no larger than the package.
"""

from __future__ import annotations

import zipfile
from pathlib import Path, PurePosixPath

from reconstruction.base.errors import InputError, LimitError
from spisim_formats.library.files import quoted

MAX_FILES = 10_000
ENCRYPTED = 1


def check_package(path: Path) -> None:
    """Raise InputError unless it is a package of uncompressed files inside it."""
    try:
        with zipfile.ZipFile(path) as package:
            files = package.infolist()
    except (OSError, ValueError, NotImplementedError, zipfile.BadZipFile):
        raise InputError(f"{path}: cannot be read as USDZ: it is no archive, or damaged") from None
    if len(files) > MAX_FILES:
        raise LimitError(f"{path}: {len(files):,} files; more than {MAX_FILES:,} are not read")
    for file in files:
        parts = PurePosixPath(file.filename.replace("\\", "/"))
        if parts.is_absolute() or ".." in parts.parts or ":" in file.filename:
            raise InputError(f"{path}: holds a file outside of it: {quoted(file.filename)}")
        if file.compress_type != zipfile.ZIP_STORED or file.flag_bits & ENCRYPTED:
            raise InputError(
                f"{path}: {quoted(file.filename)} is compressed or encrypted, which USDZ does "
                "not allow; `usdzip` makes packages that are read"
            )
    if sum(file.file_size for file in files) > path.stat().st_size:
        raise LimitError(f"{path}: its files are together larger than it, which is no package")


def read_from_package(name: str) -> bytes | None:
    """Return bytes of `package.usdz[file]`, also in nested packages; None if missing."""
    from pxr import Ar

    asset = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(name))
    return None if asset is None else bytes(asset.GetBuffer())
