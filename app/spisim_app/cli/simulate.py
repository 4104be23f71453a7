"""`spisim simulate`: a capture from a scene and an instrument."""

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from reconstruction.base.errors import naming
from reconstruction.base.timing import timed

from . import options as opt
from .console import print_json, progress_bar, say, warn
from .inputs import OWN_PLAN, PlanOptions, instrument_with, scene_with
from .outputs import beside, files_read
from .outputs import output as named
from .weather_options import OWN_WEATHER_OF_DROPS, WeatherOfDrops

EXAMPLE = "spisim simulate warehouse -o foggy.h5 --visibility 20 --report"

#: Approximate size of the readings and truth of a frame.
BYTES_PER_FRAME = 100_000


@dataclass(frozen=True)
class ReadingsOptions:
    """Readings that are made of the light."""

    seed: opt.Seed = 0
    frames: Annotated[int, opt.number_option(1, 10_000, "Frames, one after the other.")] = 1
    noise_free: Annotated[bool, typer.Option("--noise-free", help="Expected readings.")] = False


ONE_NOISY_FRAME = ReadingsOptions()


@opt.with_options
def command(
    scene: opt.SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="CAPTURE", help="HDF5 file.")],
    instrument: opt.InstrumentOption = "paper",
    wavelength: opt.Wavelength = None,
    weather: WeatherOfDrops = OWN_WEATHER_OF_DROPS,
    plan: PlanOptions = OWN_PLAN,
    stated: opt.StatedWeather = None,
    light: opt.LightOptions = opt.TRACED_OR_SURROGATE,
    readings: ReadingsOptions = ONE_NOISY_FRAME,
    report: Annotated[
        bool, typer.Option("--report", help="Also reconstruct, into a page beside the capture.")
    ] = False,
    run: opt.RunOptions = opt.RUN,
) -> None:
    """Simulate a capture of a scene, with the truth for evaluation.

    The image of a scene is traced once for all patterns; noise and conversion follow.
    """
    from reconstruction import capture_warnings, evaluate, reconstruct, write_capture
    from reconstruction.base.folders import output_files
    from spisim.simulation import simulate
    from spisim.simulation.measurement import simulation_warnings
    from spisim.transport import fine_view

    files = [named(output, "simulated capture", readings.frames * BYTES_PER_FRAME)]
    files += [beside(output, "capture report")] if report else []
    with output_files(files, files_read(scene, instrument), overwrite=run.overwrite):
        carried = instrument_with(instrument, wavelength, stated, plan)
        loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
        seconds: dict[str, float] = {}
        with timed(seconds, "simulate"), progress_bar("Tracing light", run.progress) as advance:
            simulation = simulate(
                loaded,
                carried,
                **light.arguments,
                seed=readings.seed,
                noise=not readings.noise_free,
                frames=readings.frames,
                progress=advance,
            )
        write_capture(simulation.capture, output)
        warnings = simulation_warnings(carried, simulation.transport)
        warnings += capture_warnings(simulation.capture)
        warn(warnings)
        if report:
            from spisim_app.report.capture import write_report

            with naming(output):
                result = reconstruct(simulation.capture)
            write_report(
                files[1].path,
                simulation.capture,
                result,
                metrics=evaluate(result, simulation.capture),
                transport=simulation.transport,
                view=fine_view(loaded, carried) if carried.images else None,
                timings=seconds,
                title=loaded.name,
            )
        written = [file.path for file in files]
        if run.json:
            paths = simulation.transport.paths
            print_json(
                {
                    "written": written,
                    "warnings": oddities + warnings,
                    "seconds": seconds,
                    "paths": paths,
                    "media": loaded.media_summary(),
                }
            )
        else:
            names = " and ".join(map(str, written))
            say(f"Wrote {names} in {seconds['simulate']:.1f} s.")
            folder = output.with_suffix("")
            next_step = shlex.join(["spisim", "reconstruct", str(output), "-o", str(folder)])
            say(f"Next: {next_step}")
