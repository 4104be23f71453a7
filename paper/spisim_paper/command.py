"""`spisim paper`: compute the paper's results and compare them."""

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from spisim_app.cli.console import print_json, say
from spisim_app.cli.options import Json, Overwrite

EXAMPLE = "spisim paper fig2 -o out/paper"

KIND = "figure of the paper"
PACKAGES = ("spisim", "numpy", "scipy")


class Which(Enum):
    """A result of the paper, or all."""

    fig2 = "fig2"
    table2 = "table2"
    fig3 = "fig3"
    all = "all"


def command(
    which: Annotated[Which, typer.Argument(help="Which result.")] = Which.all,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of the figures.")
    ] = Path("out/paper"),
    markdown: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Paste the tables between this file's paper marks."),
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Compute the paper's results and compare them with its numbers; exit 1 if a check fails.

    Draws each figure as PNG.
    """
    from reconstruction.base.files import Output, write_atomically
    from reconstruction.base.folders import output_folder
    from spisim_app.report.style import file_of, plot_style
    from spisim_paper.checks import (
        around_marks,
        checks_table,
        paste,
        report,
        summary,
        surroundings,
    )
    from spisim_paper.results import RESULTS

    names = list(RESULTS) if which is Which.all else [which.value]
    pictures = {name: output / f"{name}.png" for name in names}
    files = [Output(path, KIND) for path in pictures.values()]
    read = [] if markdown is None else [markdown]
    with output_folder(output, files, read, overwrite=overwrite), plot_style():
        if markdown is not None:
            around_marks(markdown, "paper")
        results = {name: RESULTS[name]() for name in names}
        for name, picture in pictures.items():
            write_atomically(picture, file_of(results[name].figure, KIND, dpi=110))
    checks = [check for result in results.values() for check in result.checks]
    tables = [table for result in results.values() for table in result.tables]
    if checks:
        tables.append(checks_table(checks))
    around = surroundings(PACKAGES)
    if json:
        written = [*pictures.values(), *read]
        print_json(summary(around, tables, checks) | {"written": written})
    else:
        report(around, tables, checks, as_json=False)
    if markdown is not None:
        paste(markdown, "paper", around, tables)
    if not json:
        drawn = ", ".join(picture.name for picture in pictures.values())
        say(f"Wrote {drawn} into {output}.")
    if not all(check.holds for check in checks):
        raise typer.Exit(1)
