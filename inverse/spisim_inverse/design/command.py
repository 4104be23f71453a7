"""`spisim design`: instruments chosen by what they measure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spisim_app.cli.console import print_json, progress_bar, say
from spisim_app.cli.options import Bar, Json, Overwrite
from spisim_app.cli.outputs import files_read, resumed

EXAMPLE = "spisim design plan.yaml -o out/design"


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN", help="What may be chosen, and for what.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of light and results.")
    ],
    overwrite: Overwrite = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Search the instrument that measures best, and judge it on scenes that it has not seen.

    Writes the instrument file and a page. Running it again goes on where it was interrupted.
    """
    from reconstruction.base.files import Output
    from reconstruction.base.folders import output_folder
    from spisim_inverse.design.page import in_words, write_design
    from spisim_inverse.design.plan import load_design
    from spisim_inverse.design.run import INSTRUMENT, KIND, PAGE, PLAN, run_design

    planned, folder = load_design(plan), output.absolute()
    page, instrument = folder / PAGE, folder / INSTRUMENT
    files = [Output(page, KIND), Output(instrument, KIND)]
    files += [] if (folder / PLAN) == planned.path else [Output(folder / PLAN, KIND)]
    with (
        output_folder(folder, files, files_read(plan), overwrite=overwrite),
        resumed(),
        progress_bar("Searching", progress) as advance,
    ):
        design = run_design(planned, folder, lambda stage, fraction: advance(fraction))
        write_design(page, design)
    if json:
        print_json(design.summary() | {"written": [page, instrument]})
        return
    for line in in_words(design):
        say(line)
    say(f"Wrote {instrument} and {page}.")
