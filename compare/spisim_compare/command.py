"""`spisim compare`: a recording and its simulation, or any two of what should be the same."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spisim_app.cli.console import print_json, say
from spisim_app.cli.options import Json, Overwrite

if TYPE_CHECKING:
    from spisim_compare.comparison import Comparison

EXAMPLE = "spisim compare recorded.h5 simulated.h5 --page compare.html"
KIND = "comparison"


def command(
    real: Annotated[
        Path, typer.Argument(metavar="REAL", help="A capture file, or an array (.npy).")
    ],
    simulated: Annotated[
        Path, typer.Argument(metavar="SIMULATED", help="The same, of what should be equal.")
    ],
    page: Annotated[
        Path | None, typer.Option(metavar="HTML", help="Write a page with pictures.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Test whether two recordings differ by more than their noise, and name what explains it.

    Captures must have the same patterns and spots. Of arrays, floating-point numbers (H, W) are an
    image, whole numbers (spots, bins) are histograms. Exit status 1 if they differ.
    """
    from reconstruction.base.files import Output
    from reconstruction.base.folders import output_files
    from spisim_compare.comparison import named
    from spisim_compare.page import write_comparison
    from spisim_compare.reading import compare_files

    outputs = [] if page is None else [Output(page, KIND, (".html", ".htm"))]
    with output_files(outputs, [real, simulated], overwrite=overwrite):
        comparison = compare_files(real, simulated)
        if page is not None:
            write_comparison(page, KIND, f"{real.stem} and {simulated.stem}", comparison)
        if json:
            print_json(comparison.summary() | {"written": [each.path for each in outputs]})
        else:
            _print(comparison)
            for each in outputs:
                say(f"Wrote {each.path}.")
        if named(comparison.verdict) != "equal":
            raise typer.Exit(1)


def _print(comparison: Comparison) -> None:
    from spisim_app.cli.console import results
    from spisim_compare.comparison import in_words

    for line in in_words(comparison):
        results.print(line, soft_wrap=True)
