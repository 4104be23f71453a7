"""`spisim budget`: light, noise, range and eye safety of an instrument, in closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import complete
from .console import print_json, results, say, warn
from .inputs import instrument_with
from .options import Json, Overwrite, Wavelength, real_option
from .outputs import files_read
from .outputs import output as named
from .tables import print_report

EXAMPLE = "spisim budget fga015 --range 4 --illuminance 20 -o budget.png"


def command(
    instrument: Annotated[
        str,
        typer.Argument(
            metavar="INSTRUMENT",
            help="An instrument file, or a preset's name.",
            autocompletion=complete.instruments,
        ),
    ] = "paper",
    wavelength: Wavelength = None,
    distance: Annotated[
        float, real_option("Of the target.", "--range", minimum=0.01, maximum=1e4, metavar="M")
    ] = 5.0,
    reflectance: Annotated[float, real_option("Of the target.", minimum=0.001, maximum=1)] = 0.5,
    illuminance: Annotated[
        float, real_option("Daylight on the target.", minimum=0, maximum=200, metavar="KLX")
    ] = 100.0,
    visibility: Annotated[
        float | None, real_option("Fog of this visibility; clear by default.", metavar="M")
    ] = None,
    correlation: Annotated[
        float | None,
        real_option(
            "Goal of averaging frames; by default 0.9 of the best.", minimum=0.01, maximum=0.99
        ),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="PNG", help="Picture to draw.")
    ] = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Light, noise, range and eye safety of an instrument that faces a flat wall."""
    from reconstruction.base.files import write_atomically
    from reconstruction.base.folders import output_files
    from spisim.atmosphere import CLEAR, fog
    from spisim.budget import Target, budget_warnings
    from spisim.budget.report import LIMIT_M, budget_tables, headline, summarise

    files = [] if output is None else [named(output, "budget")]
    with output_files(files, files_read(instrument), overwrite=overwrite):
        carried = instrument_with(instrument, wavelength)
        air = CLEAR
        if visibility is not None:
            air = fog(visibility, "moderate-radiation", wavelength_nm=carried.wavelength_nm)
        target = Target(distance, reflectance, illuminance, air.extinction_per_m)
        figures = summarise(carried, target, air, correlation)
        warn(warnings := budget_warnings(carried, target))
        if output is not None:
            from spisim.budget.plots import budget_figure
            from spisim_app.report.style import drawn, file_of, plot_style

            with plot_style():
                figure = budget_figure(carried, target, drawn(Path(instrument).stem), LIMIT_M)
                write_atomically(output, file_of(figure, "budget", dpi=110))
    if json:
        print_json({"instrument": instrument, **figures, "warnings": warnings, "written": output})
        return
    results.print(headline(figures), soft_wrap=True)
    for table in budget_tables(figures):
        print_report(table)
    if output is not None:
        say(f"Wrote {output}.")
