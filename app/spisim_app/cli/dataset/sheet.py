"""`spisim dataset sheet`: an overview page of a data set."""

from pathlib import Path
from typing import Annotated

import typer

from ..console import print_json, progress_bar, say
from ..options import Bar, Json, Overwrite, number_option
from ..outputs import output as named
from .running import Folder

EXAMPLE = "spisim dataset sheet out/fog -o fog.html --limit 50"


def command(
    folder: Folder,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="PAGE", help="HTML file.")],
    limit: Annotated[
        int, number_option(1, 10_000, "Maximum number of samples, evenly chosen.")
    ] = 100,
    overwrite: Overwrite = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Write a page with image, estimated and true depth, parameters and error of each sample."""
    from reconstruction.base.folders import output_files
    from spisim.dataset import open as open_data_set
    from spisim_app.report.contact_sheet import write_contact_sheet

    with output_files([named(output, "contact sheet")], [folder], overwrite=overwrite):
        data = open_data_set(folder)
        with progress_bar("Reconstructing", progress) as advance:
            count = write_contact_sheet(output, data, limit, advance)
        if json:
            print_json({"written": [output], "samples": count})
        else:
            say(f"Wrote {count} samples to {output}.")
            say(f"Look at it: {output.resolve().as_uri()}")
