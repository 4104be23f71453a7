"""Tables of results for people."""

from collections.abc import Mapping
from typing import Any

from rich.table import Table

from .console import results


def print_errors(metrics: Mapping[str, Any]) -> None:
    """Print image, range and depth errors, as `reconstruction.evaluate` returns them."""
    from spisim.report.comparison import compared_methods, compared_spots, written

    for compared in (*compared_methods(metrics), *compared_spots(metrics)):
        table = plain_table(compared.name, *compared.columns)
        for row in compared.rows:
            table.add_row(*row)
        results.print(table)
    error = written(metrics["truth"]["image_error"], 100, "{:.1f} %")
    results.print(f"standard error of the true image, RMS: {error}\n", style="dim")


def plain_table(first: str, *columns: str, least: int = 11) -> Table:
    """A table without lines: a column of words, and others for numbers of `least` characters."""
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0))
    table.add_column(first, min_width=21)
    for column in columns:
        width = max(least, *(len(word) for word in column.split()))
        table.add_column(column, justify="right", min_width=width)
    return table
