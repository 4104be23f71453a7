"""Files that configuration files refer to, pictures and tables of numbers, and CSV for others."""

from __future__ import annotations

import csv
import io
import os
import struct
from collections.abc import Iterable
from pathlib import Path, PosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base import npy
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from reconstruction.base.text import printable
from spisim.base.config.reading import read_text

MAX_PIXELS = 2**24
MAX_TABLE_BYTES = 2**26
#: Spreadsheets take a cell that begins so for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\n", "＝", "＋", "－", "＠")


class EnclosedFolder(PosixPath):
    """Folder for the names in a text that came with a recording: none leads out of it."""

    def __truediv__(self, name: str | os.PathLike[str]) -> EnclosedFolder:
        path = super().__truediv__(name)
        if not path.resolve().is_relative_to(self.resolve()):
            raise InputError(f"{str(name)!r} lies outside of {self}, and is not opened")
        return path


def check_is_there(path: Path, kind: str) -> None:
    """InputError, naming the nearest file of the same suffix, if `path` is no regular file."""
    if path.is_dir():
        raise InputError(f"{kind} {path.name!r} is a folder: {path}")
    if path.exists() and not path.is_file():
        raise InputError(f"{kind} {path.name!r} is a device or pipe, not a regular file: {path}")
    if not path.is_file():
        others = sorted(other.name for other in path.parent.glob(f"*{path.suffix}"))
        hint = f" in {path.parent}; {nearest(path.name, others)}" if others else f": {path}"
        raise InputError(f"no {kind} {path.name!r}{hint}")


def read_npy(path: Path, kind: str) -> NDArray[Any]:
    """Real array of an NPY file; InputError, naming its `kind`, for any other file."""
    try:
        with path.open("rb") as file:
            return npy.read_npy(file, path.stat().st_size)
    except (OSError, InputError) as error:
        raise InputError(f"{kind} {path.name!r} cannot be read: {error}") from None


def read_picture(path: Path) -> NDArray[np.float32]:
    """Linear greyscale picture (h, w) with values from 0 to 1, from a PNG or NPY file."""
    check_is_there(path, "picture")
    if path.suffix.lower() == ".npy":
        picture = read_npy(path, "picture")
    elif path.suffix.lower() == ".png":
        picture = _read_png(path)
    else:
        raise InputError(f"picture {path.name!r} should be a PNG or NPY file")
    if picture.ndim != 2 or 0 in picture.shape:
        raise InputError(
            f"picture {path.name!r} should be grey, (height, width); found shape {picture.shape}: "
            "colours have no meaning at 1550 nm"
        )
    if not ((picture >= 0) & (picture <= 1)).all():
        raise InputError(f"picture {path.name!r} should hold values from 0 to 1")
    return picture.astype(np.float32)


def grey_picture(path: Path) -> Floats:
    """Mean of the colour channels (h, w), 0 to 1, of a PNG file without its transparency."""
    check_is_there(path, "picture")
    if path.suffix.lower() != ".png":
        raise InputError(f"picture {path.name!r} should be a PNG file")
    values = np.asarray(_read_png(path), dtype=np.float64)
    if values.ndim == 2:
        return values
    return np.asarray(values[..., : 1 if values.shape[-1] <= 2 else 3].mean(axis=-1))


def read_density(path: Path) -> NDArray[np.float32]:
    """Relative density (nz, ny, nx) from 0 to 1, not zero everywhere, from an NPY file."""
    check_is_there(path, "density")
    density = read_npy(path, "density")
    if density.ndim != 3 or 0 in density.shape:
        raise InputError(
            f"density {path.name!r} should be 3-D, (nz, ny, nx); found shape {density.shape}"
        )
    if not np.isfinite(density).all():
        raise InputError(f"density {path.name!r} has values that are not finite (NaN or infinite)")
    if density.min() < 0 or density.max() > 1:
        raise InputError(
            f"density {path.name!r} should lie between 0 and 1, relative to the given extinction; "
            f"it spans {density.min():g} to {density.max():g}"
        )
    if not density.any():
        raise InputError(f"density {path.name!r} is zero everywhere")
    return density.astype(np.float32)


def read_columns(path: Path) -> Floats:
    """Table of numbers (rows, columns) from a CSV file, with or without header, or an NPY file.

    Error messages never quote the content: the file named may be somebody's private text.
    """
    check_is_there(path, "table")
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return np.atleast_2d(read_npy(path, "table").astype(np.float64))
    size = path.stat().st_size
    if size > MAX_TABLE_BYTES:
        raise InputError(
            f"table {path.name!r} has {size / 2**20:.0f} MiB, at most {MAX_TABLE_BYTES // 2**20} "
            "of text are read: save it as an NPY file"
        )
    if suffix != ".csv":
        raise InputError(f"table {path.name!r} should be a CSV or NPY file")
    lines = read_text(path, "a table in CSV").splitlines()
    has_header = bool(lines) and not is_number(lines[0].partition(",")[0])
    rows = [
        [_number(cell, path, number) for cell in line.split(",")]
        for number, line in enumerate(lines[has_header:], start=1 + has_header)
        if line.strip()
    ]
    if len({len(row) for row in rows}) > 1:
        raise InputError(f"table {path.name!r}: its lines differ in length")
    return np.array(rows, dtype=np.float64)


def _number(cell: str, path: Path, line: int) -> float:
    try:
        return float(cell)
    except ValueError:
        raise InputError(
            f"table {path.name!r}, line {line}: should hold numbers with commas between them"
        ) from None


def _read_png(path: Path) -> NDArray[Any]:
    import matplotlib.image

    _check_pixels(path)
    try:
        return np.asarray(matplotlib.image.imread(path, format="png"))
    # The decoder raises many kinds of exceptions for damaged files.
    except Exception:
        raise InputError(f"picture {path.name!r} cannot be read: not PNG, or damaged") from None


def _check_pixels(path: Path) -> None:
    """Check the size in the header before decoding: a small PNG file may hold a huge picture."""
    with path.open("rb") as file:
        head = file.read(24)
    width, height = struct.unpack(">II", head[16:]) if len(head) == 24 else (0, 0)
    if width * height > MAX_PIXELS:
        raise InputError(
            f"picture {path.name!r} has {width} x {height} pixels, at most {MAX_PIXELS} are read"
        )


def csv_table(rows: Iterable[Iterable[Any]]) -> str:
    """Rows of cells as CSV text; an apostrophe precedes text that looks like a formula."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows([_harmless(cell) for cell in row] for row in rows)
    return buffer.getvalue()


def _harmless(cell: Any) -> Any:
    if not isinstance(cell, str):
        return cell
    text = printable(cell)
    return f"'{text}" if text.startswith(_FORMULA) and not is_number(text) else text


def is_number(text: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
