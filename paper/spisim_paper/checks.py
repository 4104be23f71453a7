"""Results with tables, checks against promised limits, and pages of the docs that hold them."""

import datetime
import json
import os
import platform
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from math import isfinite
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from reconstruction.base.errors import InputError
from reconstruction.base.files import require_file, write_atomically


@dataclass(frozen=True)
class Table:
    """Columns and rows of text with a title; or a paragraph alone."""

    title: str
    columns: tuple[str, ...] = ()
    rows: Sequence[tuple[str, ...]] = ()

    def text(self) -> str:
        """Plain text for a terminal."""
        if not self.columns:
            return f"{textwrap.fill(self.title, 100)}\n"
        lines = [self.columns, *self.rows]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.columns))]
        cells = ("  ".join(map(str.ljust, line, widths)).rstrip() for line in lines)
        return "\n".join([self.title, "", *cells, ""])

    def markdown(self) -> str:
        """Markdown for the docs."""
        if not self.columns:
            return f"{self.title}\n"
        lines = [self.columns, ("---",) * len(self.columns), *self.rows]
        cells = (f"| {' | '.join(line)} |" for line in lines)
        return "\n".join([self.title, "", *cells, ""])

    def summary(self) -> dict[str, Any]:
        """The table, JSON-ready."""
        rows = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        return {"title": self.title, "rows": rows}


#: Reflectances of the targets, and their colours in all figures.
REFLECTANCES = (0.2, 0.5, 0.8)
COLOURS = ("#1f5f8b", "#d1762c", "#3f8f4f")

Interval = Callable[[float], tuple[float, float]]
"""Confidence interval of a figure, by confidence."""
HELD, FAILED = 0.95, 0.999
"""Confidence that a promise holds or fails: of a hundred kept ones, none fails."""


@dataclass(frozen=True)
class Check:
    """A figure with a promised limit; `interval` gives its confidence interval if it is sampled."""

    name: str
    value: float
    limit: float
    at_least: bool = False
    interval: Interval | None = None

    @property
    def holds(self) -> bool | None:
        """Whether the promise is kept; None if the samples are too few."""
        if self.interval is None:
            return self._within_limit(self.value)
        if all(map(self._within_limit, self.interval(HELD))):
            return True
        return None if any(map(self._within_limit, self.interval(FAILED))) else False

    def _within_limit(self, value: float) -> bool:
        return bool(value >= self.limit if self.at_least else value <= self.limit)

    def summary(self) -> dict[str, Any]:
        """The check, JSON-ready."""
        interval = self.interval and [
            each if isfinite(each) else None for each in self.interval(HELD)
        ]
        return {
            "name": self.name,
            "value": self.value,
            "interval": interval,
            "limit": self.limit,
            "holds": self.holds,
        }

    def measured(self) -> str:
        """The figure and its interval as text."""
        if self.interval is None:
            return f"{self.value:.3g}"
        low, high = self.interval(HELD)
        return f"{self.value:.3g} ({low:.3g} to {high:.3g})"


@dataclass(frozen=True, eq=False)
class Result:
    """Tables and paragraphs, promised figures, and the plot."""

    tables: Sequence[Table]
    checks: Sequence[Check]
    figure: Figure


def percent(deviation: float) -> str:
    """A relative deviation with its sign."""
    return f"{100 * deviation:+.0f} %"


VERDICTS = {True: "holds", False: "FAILS", None: "cannot tell"}


def checks_table(checks: Sequence[Check]) -> Table:
    """The promised figures and whether they hold."""
    rows = [
        (
            check.name,
            check.measured(),
            f"{'≥' if check.at_least else '≤'} {check.limit:g}",
            VERDICTS[check.holds],
        )
        for check in checks
    ]
    return Table("What is promised:", ("figure", "measured", "limit", ""), rows)


def surroundings(packages: Sequence[str]) -> dict[str, Any]:
    """Date, machine and versions of installed packages that a figure depends on."""
    return {
        "date": datetime.date.today().isoformat(),
        "machine": f"{_processor()}, {os.cpu_count()} cores, {platform.system()}",
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in packages if _installed(name)},
        },
    }


def _installed(package: str) -> bool:
    try:
        version(package)
    except PackageNotFoundError:
        return False
    return True


def surroundings_line(around: dict[str, Any]) -> str:
    """The same as a sentence."""
    versions = ", ".join(f"{name} {number}" for name, number in around["versions"].items())
    return f"Measured on {around['date']}: {around['machine']}; {versions}."


def report(
    around: dict[str, Any], tables: Sequence[Table], checks: Sequence[Check], *, as_json: bool
) -> None:
    """Print everything; with `as_json` the last line is one JSON object."""
    print(surroundings_line(around), end="\n\n")
    for table in tables:
        print(table.text())
    if as_json:
        print(json.dumps(summary(around, tables, checks)))


def summary(
    around: dict[str, Any], tables: Sequence[Table], checks: Sequence[Check]
) -> dict[str, Any]:
    """Everything, JSON-ready."""
    return {
        **around,
        "tables": [table.summary() for table in tables],
        "checks": [check.summary() for check in checks],
    }


def paste(path: Path, name: str, around: dict[str, Any], tables: Sequence[Table]) -> None:
    """Replace the text between `<!-- name -->` and `<!-- /name -->` in a Markdown file."""
    before, after = around_marks(path, name)
    body = "\n".join([surroundings_line(around), "", *(table.markdown() for table in tables)])
    write_atomically(path, f"{before}\n\n{body}\n{after}".encode())


def around_marks(path: Path, name: str) -> tuple[str, str]:
    """Text up to `<!-- name -->` and from `<!-- /name -->` on, with the marks; or InputError."""
    opening, closing = f"<!-- {name} -->", f"<!-- /{name} -->"
    require_file(path)
    try:
        before, opened, rest = path.read_text(encoding="utf-8").partition(opening)
    except UnicodeDecodeError:
        raise InputError(f"{path} is not UTF-8 text; a Markdown file is expected") from None
    _, ended, after = rest.partition(closing)
    if not (opened and ended):
        raise InputError(f"{path} lacks the marks {opening} and {closing}")
    return before + opening, closing + after


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
