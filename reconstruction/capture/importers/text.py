"""Tables of numbers in text: any separator, headings, comments, decimal points or commas."""

import codecs
import re
import unicodedata
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.errors import InputError, nearest

MAX_BYTES = 2**28
MAX_HEADING_LINES = 1000
"""Maximum number of lines before the first numbers."""
COMMENT = re.compile(r"#.*|^\s*(%|//|!).*")
NUMBER = re.compile(
    r"[+-]?((\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?|nan|inf(inity)?)", re.IGNORECASE
)
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
DECIMALS = re.compile(r"0\d+(\.\d*)?")
"""Digits after a comma that cannot be a count."""


SCALAR = re.compile(r"\b(?:np|numpy)\.\w+\(([^()]*)\)")
"""A number as NumPy 2 shows it: np.float64(1.5)."""
LIST = re.compile(r"\s*[\[(]+(?=\s*[-+.\d])([^\[\]()]*?)[\])]+,?\s*")
"""A line that is a list or tuple of Python."""
SAMPLE_LINES = 100
"""Last lines, by which a table is distinguished from settings before it."""


class _Table(NamedTuple):
    """Layout of a table: separator (None for spaces), decimal mark, headings, first line."""

    separator: str | None
    comma: bool
    headings: list[str]
    columns: int
    start: int


def read_text(path: Path, column: str | None) -> NDArray[Any]:
    """Numbers (lines, columns) of a text file, or one ``column`` by heading or number from 0.

    Lines before the first with numbers, which may have words beside them, are headings; the last of
    them names the columns. Raises InputError without numbers, if lines differ in their columns, and
    if a comma may be a decimal mark or a separator.
    """
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise InputError(
            f"has {size / 2**20:.0f} MiB; at most {MAX_BYTES // 2**20} MiB of text are read: save "
            "it as .npy"
        )
    lines = [_plain(line) for line in _text(path.read_bytes()).splitlines()]
    table = _table(lines)
    if table is None:
        if any(line.strip() for line in lines):
            raise InputError("should hold numbers, in lines with the same number of columns")
        return np.empty(0)
    columns = None if column is None else [_column(column, table)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            numbers = np.loadtxt(
                _body(lines, table), delimiter=table.separator, usecols=columns, comments=None
            )
        except (ValueError, IndexError):
            raise InputError(_complaint(lines, table, columns)) from None
    if columns is None and (table.separator, table.columns, table.headings) == (",", 2, []):
        _check_comma(lines, table)
    return numbers


def _text(content: bytes) -> str:
    sixteen = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return content.decode("utf-16" if sixteen else "utf-8-sig", "replace")


def _plain(line: str) -> str:
    """A line without comments, and without what Python's repr writes around numbers."""
    line = SCALAR.sub(r"\1", COMMENT.sub("", line))
    return match[1] if (match := LIST.fullmatch(line)) else line


def _body(lines: list[str], table: _Table) -> Iterator[str]:
    """Lines of numbers in a form that NumPy reads."""
    fortran = FORTRAN.search(lines[table.start]) is not None
    for line in lines[table.start :]:
        plain = line.replace('"', "")
        if table.comma:
            plain = plain.replace(",", ".")
        yield FORTRAN.sub("e", plain) if fortran else plain


def _check_comma(lines: list[str], table: _Table) -> None:
    """Raise InputError for two columns that may be one with decimal commas."""
    behind = [_cells(line, ",")[-1] for line in lines[table.start :] if line.strip()]
    if all(len(each) == 1 for each in behind) or any(map(DECIMALS.fullmatch, behind)):
        raise InputError(
            f"line {table.start + 1} has {lines[table.start].strip()[:40]!r}: one number or two "
            "columns? write numbers with a point alone, or semicolons between columns"
        )


def _table(lines: list[str]) -> _Table | None:
    """Layout of the table; None if no line has numbers."""
    headings: list[str] = []
    usual = _usual_numbers(lines)
    for start, line in enumerate(islice(lines, MAX_HEADING_LINES)):
        separator, comma = _separator(line)
        cells = _cells(line, separator)
        numbers = _numbers(cells)
        words = any(cell and not number for cell, number in zip(cells, numbers, strict=True))
        if any(numbers) and (not words or _covers(numbers, usual)):
            composed = [unicodedata.normalize("NFC", each) for each in headings]
            named = composed if len(headings) == len(cells) else []
            return _Table(separator, comma, named, len(cells), start)
        headings = cells or headings
    return None


def _numbers(cells: list[str]) -> list[bool]:
    """Which cells are numbers."""
    return [NUMBER.fullmatch(cell) is not None for cell in cells]


def _usual_numbers(lines: list[str]) -> Sequence[bool]:
    """Which cells are numbers in most of the last lines; of equally many, where most cells are."""
    last = [line for line in lines[-SAMPLE_LINES:] if line.strip()]
    kinds = Counter(tuple(_numbers(_cells(line, _separator(line)[0]))) for line in last)
    return max(kinds, key=lambda kind: (any(kind), kinds[kind], sum(kind)), default=())


def _covers(numbers: Sequence[bool], usual: Sequence[bool]) -> bool:
    """Whether a line has all numbers of the usual one, and as many cells."""
    both = zip(numbers, usual, strict=True) if len(numbers) == len(usual) else [(False, True)]
    return all(here or not there for here, there in both)


def _separator(line: str) -> tuple[str | None, bool]:
    """Separator of a line, None for spaces, and whether its decimal mark is a comma."""
    for separator in ("\t", ";"):
        if separator in line:
            return separator, "," in line
    cells = line.split()
    if len(cells) > 1 and all(DECIMAL_COMMA.fullmatch(cell) for cell in cells):
        return None, True
    return ("," if "," in line else None), False


def _cells(line: str, separator: str | None) -> list[str]:
    return [cell.strip().strip('"') for cell in line.split(separator)] if line.strip() else []


def _column(name: str, table: _Table) -> int:
    name = unicodedata.normalize("NFC", name)  # keyboards and file systems differ
    if name in table.headings:
        return table.headings.index(name)
    if name.isascii() and name.isdecimal() and int(name[:9]) < table.columns:
        return int(name[:9])
    available = [*table.headings, *map(str, range(table.columns))]
    raise InputError(f"has no column {name!r}: {nearest(name, available)}")


def _is_read(cell: str, table: _Table) -> bool:
    plain = FORTRAN.sub("e", cell.replace(",", ".") if table.comma else cell)
    with suppress(ValueError):
        float(plain)
        return "_" not in plain
    return False


def _complaint(lines: list[str], table: _Table, columns: list[int] | None) -> str:
    """Description of the first wrong line."""
    for number, line in enumerate(lines[table.start :], table.start + 1):
        cells = _cells(line, table.separator)
        if not cells:
            continue
        if len(cells) != table.columns:
            return (
                f"should hold numbers, in lines with the same number of columns; line {number} has "
                f"{len(cells)}, line {table.start + 1} {table.columns}"
            )
        for position in range(table.columns) if columns is None else columns:
            if not _is_read(cells[position], table):
                named = f" ({table.headings[position]})" if table.headings else ""
                return (
                    f"should hold numbers; line {number} has {cells[position][:40]!r} in column "
                    f"{position}{named}: name the column of the readings"
                )
    return "should hold numbers, in lines with the same number of columns"
