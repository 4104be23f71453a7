"""`spisim fit`: scene, weather and instrument that explain a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spisim_app.cli import options as opt
from spisim_app.cli.console import print_json, progress_bar, say, warn
from spisim_app.cli.inputs import instrument_with, scene_with
from spisim_app.cli.outputs import files_read
from spisim_app.cli.weather_options import OWN_WEATHER, Weather

if TYPE_CHECKING:
    from reconstruction import Capture
    from spisim.instrument import Instrument
    from spisim_inverse.fit.result import Fitted

EXAMPLE = (
    "spisim fit recorded.h5 --scene hall.yaml --visibility 100 --free scene.fog.visibility_m "
    "--page fit.html"
)
PAGE = "fit"


@opt.with_options
def command(
    capture: opt.CaptureArgument,
    scene: Annotated[
        str, typer.Option("--scene", metavar="SCENE", help="A scene file, or a shipped one's name.")
    ],
    free: Annotated[
        list[str],
        typer.Option(
            "--free",
            metavar="NAME[=START]",
            help="A free parameter, such as scene.fog.visibility_m=100 or materials.concrete; "
            "several by commas.",
        ),
    ],
    instrument: Annotated[
        str | None,
        typer.Option("--instrument", help="An instrument file or preset; the capture's own."),
    ] = None,
    weather: Weather = OWN_WEATHER,
    prior: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=MEAN±SIGMA", help="A normal distribution of a parameter."),
    ] = None,
    priors: Annotated[
        Path | None, typer.Option(metavar="YAML", help="The same of a file: NAME: MEAN±SIGMA.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="YAML", help="Scene file with the estimates."),
    ] = None,
    output_instrument: Annotated[
        Path | None, typer.Option(metavar="YAML", help="Instrument file with the estimates.")
    ] = None,
    page: Annotated[
        Path | None, typer.Option(metavar="HTML", help="Write a page with residuals.")
    ] = None,
    spp: Annotated[
        int, opt.number_option(8, 2**20, "Light paths per virtual pixel of the last steps.")
    ] = 128,
    seed: opt.Seed = 0,
    frames: Annotated[
        int, opt.number_option(1, 1000, "Frames of a flight, each in its pose; more take longer.")
    ] = 6,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
    progress: opt.Bar = None,
) -> None:
    """Estimate named parameters by a recording, simulated or measured, with their covariance.

    Exit status 1 if the model does not fit.
    """
    from reconstruction import read_capture
    from reconstruction.base.errors import naming
    from reconstruction.base.files import Output
    from reconstruction.base.folders import output_files
    from spisim.base.config import find_named
    from spisim.scene import scenes_folder
    from spisim_inverse.fit.fitting import fit
    from spisim_inverse.fit.page import write_fit
    from spisim_inverse.fit.priors import parsed_priors, parsed_starts, read_priors
    from spisim_inverse.fit.result import in_words
    from spisim_inverse.fit.written import INSTRUMENT, SCENE, write_fitted

    yaml = (".yaml", ".yml")
    outputs = [
        Output(path, kind, endings)
        for path, kind, endings in (
            (output, SCENE, yaml),
            (output_instrument, INSTRUMENT, yaml),
            (page, PAGE, (".html", ".htm")),
        )
        if path is not None
    ]
    file = find_named(scene, scenes_folder(), "scene")
    read = files_read(*(each for each in (capture, file, instrument, priors) if each is not None))
    with output_files(outputs, read, overwrite=overwrite):
        starts = parsed_starts(free)
        beliefs = {} if priors is None else read_priors(priors)
        beliefs |= parsed_priors(prior or ())
        recorded = read_capture(capture)
        carried = _instrument(recorded, capture, instrument)
        loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
        with naming(capture), progress_bar("Fitting", progress) as advance:
            fitted = fit(
                recorded, loaded, carried, starts, priors=beliefs, spp=spp, seed=seed,
                frames=frames, progress=advance,
            )  # fmt: skip
        write_fitted(fitted, output, output_instrument, file.parent)
        if page is not None:
            write_fit(page, PAGE, f"{capture.stem} by {loaded.name}", fitted)
        written = [each.path for each in outputs]
        if json:
            print_json(fitted.summary() | {"warnings": oddities, "written": written})
        else:
            _print(fitted, in_words(fitted))
            for path in written:
                say(f"Wrote {path}.")
        if not fitted.fits:
            raise typer.Exit(1)


def _instrument(capture: Capture, path: Path, name: str | None) -> Instrument:
    """Load the instrument, or read the one that the capture holds."""
    from reconstruction.base.errors import InputError
    from spisim.instrument import embedded_instrument

    if name is not None:
        return instrument_with(name)
    if not capture.provenance.instrument:
        raise InputError("the capture does not hold its instrument: name a file by --instrument")
    return embedded_instrument(capture.provenance.instrument, path)


def _print(fitted: Fitted, lines: list[str]) -> None:
    from spisim_app.cli.console import results

    for line in lines:
        results.print(line, soft_wrap=True)
    warn(fitted.warnings)
