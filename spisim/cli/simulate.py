"""`spisim simulate`: a capture from a scene and an instrument."""

import shlex
from pathlib import Path
from typing import Annotated, Literal

import typer

from reconstruction.base.errors import naming
from reconstruction.base.timing import timed

from . import options as opt
from .console import print_json, progress_bar, say, warn
from .inputs import instrument_with, scene_with
from .outputs import beside, files_read
from .outputs import output as named
from .weather_options import OWN_WEATHER_OF_DROPS, WeatherOfDrops, with_weather

EXAMPLE = "spisim simulate warehouse -o foggy.h5 --visibility 20 --report"

#: Approximate size of a frame's readings and truth.
BYTES_PER_FRAME = 100_000


@with_weather
def command(
    scene: opt.SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="CAPTURE", help="HDF5 file.")],
    instrument: opt.InstrumentOption = "paper",
    wavelength: opt.Wavelength = None,
    weather: WeatherOfDrops = OWN_WEATHER_OF_DROPS,
    patterns: Annotated[int | None, opt.number_option(1, 2**31, "Patterns per frame.")] = None,
    order: Annotated[str | None, typer.Option(help="Which patterns come first.")] = None,
    polarity: Annotated[str | None, typer.Option(help="differential or single-ended.")] = None,
    interleave: Annotated[
        int | None, opt.number_option(1, 256, "Frames over which patterns are distributed.")
    ] = None,
    stated: opt.StatedWeather = None,
    seed: opt.Seed = 0,
    light: Annotated[
        Literal["traced", "surrogate"], typer.Option(help="surrogate: fast, for training data.")
    ] = "traced",
    spp: opt.SppOrShare = None,
    transport_noise_share: opt.NoiseShare = None,
    frames: Annotated[int, opt.number_option(1, 10_000, "Consecutive frames.")] = 1,
    noise_free: Annotated[bool, typer.Option("--noise-free", help="Expected readings.")] = False,
    report: Annotated[
        bool, typer.Option("--report", help="Also reconstruct, into a page beside the capture.")
    ] = False,
    overwrite: opt.Overwrite = False,
    json: opt.Json = False,
    progress: opt.Bar = None,
) -> None:
    """Simulate a capture of a scene, with the truth for evaluation.

    The image of a scene is traced once for all patterns; noise and conversion follow.
    """
    from reconstruction import capture_warnings, evaluate, reconstruct, write_capture
    from reconstruction.base.files import require_outputs
    from spisim.simulation import simulate
    from spisim.simulation.measurement import simulation_warnings
    from spisim.transport import fine_view

    budget = opt.light_budget(spp, transport_noise_share)
    files = [named(output, "simulated capture", frames * BYTES_PER_FRAME)]
    files += [beside(output, "capture report")] if report else []
    require_outputs(files, files_read(scene, instrument), overwrite=overwrite)
    carried = instrument_with(instrument, wavelength, patterns, order, polarity, interleave, stated)
    loaded, oddities = scene_with(scene, carried.wavelength_nm, weather)
    seconds: dict[str, float] = {}
    with timed(seconds, "simulate"), progress_bar("Tracing light", progress) as advance:
        simulation = simulate(
            loaded,
            carried,
            light=light,
            **budget,
            seed=seed,
            noise=not noise_free,
            frames=frames,
            progress=advance,
        )
    write_capture(simulation.capture, output)
    warnings = simulation_warnings(carried, simulation.transport)
    warnings += capture_warnings(simulation.capture)
    warn(warnings)
    if report:
        from spisim.report.capture import write_report

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
    if json:
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
