"""Tables of results as text."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rich.measure import Measurement
from rich.padding import Padding
from rich.table import Table

from .console import results

if TYPE_CHECKING:
    from reconstruction.evaluation.comparison import Comparison
    from spisim.atmosphere.report import ReportTable

#: Minimum width of a text column.
MIN_WORDS = 8
#: More than any table needs.
WIDEST = 10_000


def print_errors(metrics: Mapping[str, Any]) -> None:
    """Print image, range and depth errors, as `reconstruction.evaluate` returns them."""
    from reconstruction.evaluation.comparison import compared_methods, compared_spots, written

    _print_all([*compared_methods(metrics), *compared_spots(metrics)])
    if not metrics["images"]:
        return
    error = written(metrics["truth"]["image_error"], 100, "{:.1f} %")
    results.print(f"standard error of the true image, RMS: {error}\n", style="dim")


def print_spots(metrics: Mapping[str, Any], of: str) -> None:
    """Print only range errors, of a named instrument."""
    from reconstruction.evaluation.comparison import compared_spots

    _print_all(compared_spots(metrics, of))


def print_recording(recording: Mapping[str, Any]) -> None:
    """Print the repeatability of a recording, as returned by `evaluate_recording`."""
    from reconstruction.evaluation.comparison import written

    table = plain_table("", "saturated", "noise", "expected", "noise ratio")
    for name in ("readings", "taps"):
        if (part := recording[name]) is not None:
            numbers = (part[key] for key in ("noise", "expected"))
            cells = [written(each, 1, f"{{:.4g}} {part['unit']}s") for each in numbers]
            saturated = written(part["saturated"], 100, "{:.3g} %")
            table.add_row(name, saturated, *cells, written(part["noise_ratio"], 1, "{:.2f}"))
    print_table(table)
    if (image := recording["image"]) is not None:
        ratio = written(image["signal_over_noise"], 1, "{:.3g}")
        results.print(f"\nzero-filled image, signal over noise: {ratio}")
    for name, spots in recording["spots"].items():
        table = plain_table(name, "range", "spread", "sigma", "spread ratio", "ranged")
        for spot, each in enumerate(spots):
            lengths = (
                written(each[key], 1, "{:.4f} m") for key in ("range_m", "spread_m", "sigma_m")
            )
            ratio = written(each["spread_ratio"], 1, "{:.2f}")
            table.add_row(f"spot {spot}", *lengths, ratio, written(each["ranged"], 100, "{:.0f} %"))
        print_table(table)
    if (visibility := recording["visibility"]) is not None:
        median, bound = (
            written(visibility[key], 1, "{:.3g} m") for key in ("visibility_m", "at_least_m")
        )
        results.print(f"visibility (2 % contrast): {median}, at least {bound}")
    if recording["frames"] < 2:
        results.print(
            "one frame: noise and spread need at least two of a static scene", style="dim"
        )
    else:
        results.print(f"of {recording['frames']} frames, assuming a static scene", style="dim")


def print_flight(comparison: Mapping[str, Any]) -> None:
    """Print the comparison of a flight's frames, as returned by `evaluate_flight`."""
    from reconstruction.evaluation.comparison import compared_flight, ratio_sentences

    _print_all([compared_flight(comparison)])
    for sentence in ratio_sentences(comparison):
        results.print(sentence, soft_wrap=True)


def _print_all(comparisons: Iterable[Comparison]) -> None:
    for compared in comparisons:
        table = plain_table(compared.name, *compared.columns)
        for row in compared.rows:
            table.add_row(*row)
        print_table(table)


def plain_table(first: str, *columns: str, minimum: int = 11) -> Table:
    """Return a table without lines: a text column, and others for `minimum` characters."""
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    table.add_column(first, min_width=21, overflow="fold")
    for column in columns:
        width = max(minimum, *(len(word) for word in column.split()))
        table.add_column(column, justify="right", min_width=width, overflow="fold")
    return table


def word_table(*columns: str) -> Table:
    """Return a table of text without lines; without `columns` it has no header."""
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), show_header=bool(columns))
    for column in columns:
        table.add_column(column, min_width=min(MIN_WORDS, len(column)), overflow="fold")
    return table


def print_table(table: Table) -> None:
    """Print a table; on a narrow terminal row by row, with each value in its own line."""
    minimum = Measurement.get(results, results.options.update_width(WIDEST), table).minimum
    if minimum <= results.width:
        results.print(table)
    elif results.is_terminal or "COLUMNS" in os.environ:
        _print_rows(table)
    else:
        results.print(table, width=minimum, crop=False)


def print_report(report: ReportTable) -> None:
    """Print a table of results and its note."""
    table = plain_table(*report.columns, minimum=report.digits)
    for row in report.rows:
        table.add_row(*row)
    print_table(table)
    if report.note is not None:
        results.print(report.note, style="dim" if report.dim else None, soft_wrap=True)


def _print_rows(table: Table) -> None:
    names = [str(column.header) for column in table.columns]
    for first, *others in zip(*(column.cells for column in table.columns), strict=True):
        results.print(f"{names[0]}: {first}" if names[0] else first)
        for name, value in zip(names[1:], others, strict=True):
            if value:
                results.print(Padding(f"{name}: {value}", (0, 0, 0, 2), expand=False))
