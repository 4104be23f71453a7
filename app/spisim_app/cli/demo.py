"""`spisim demo`: the whole chain, from a scene to a depth map."""

from pathlib import Path
from typing import Annotated

import typer

from reconstruction.base.timing import timed

from .console import print_json, progress_bar, say, warn
from .options import Bar, Json, Overwrite, Seed, Spp
from .tables import print_errors, print_spots

EXAMPLE = "spisim demo -o out/demo"
#: Light paths for the instrument of the page.
FRACTION = 0.8

#: Further files and their kinds.
FILES = {
    "capture.h5": "simulated capture",
    "truth.exr": "transport image",
    "overview.png": "overview",
    "report.html": "capture report",
}


def command(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")
    ] = Path("out/demo"),
    seed: Seed = 0,
    spp: Spp = 1024,
    overwrite: Overwrite = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Simulate two instruments in a foggy warehouse, reconstruct, and compare with the truth.

    The first is the preset `fog`, which measures through fog. The second is the paper's single
    frequency, whose ranges depend on a prior of the weather and carry a warning.
    """
    from reconstruction import capture_warnings, evaluate, reconstruct, write_capture, write_outputs
    from reconstruction.base.files import Output
    from reconstruction.base.folders import output_folder
    from reconstruction.outputs import outputs_in
    from spisim.instrument import load_instrument
    from spisim.scene import load_scene
    from spisim.simulation import simulate
    from spisim.simulation.light.files import write_truth
    from spisim.simulation.measurement import simulation_warnings
    from spisim.transport import fine_view
    from spisim_app.report.capture import write_report
    from spisim_app.report.overview import write_overview

    own = {name: Output(output / name, kind) for name, kind in FILES.items()}
    files = [*own.values(), *outputs_in(output)]
    with output_folder(output, files, overwrite=overwrite):
        seconds: dict[str, float] = {}
        with timed(seconds, "load"):
            scene = load_scene("warehouse")
            instrument, paper = load_instrument("fog"), load_instrument("paper")
        with timed(seconds, "simulate"), progress_bar("Tracing light", progress) as advance:
            simulation = simulate(
                scene,
                instrument,
                spp=spp,
                seed=seed,
                progress=lambda done: advance(FRACTION * done),
            )
            other = simulate(
                scene,
                paper,
                spp=max(1, round(spp * (1 - FRACTION) / FRACTION)),
                seed=seed,
                progress=lambda done: advance(FRACTION + (1 - FRACTION) * done),
            ).capture
        with timed(seconds, "scene view"):
            view = fine_view(scene, instrument)
        capture, light = simulation.capture, simulation.transport
        result = reconstruct(capture, ranging="fog")
        metrics = evaluate(result, capture)
        beside = evaluate(reconstruct(other, ranging="fog", depth=()), other)

        write_capture(capture, own["capture.h5"].path)
        write_truth(own["truth.exr"].path, simulation.truths[0], {"transport": light.image})
        pictures = write_outputs(result, capture, output)
        write_overview(own["overview.png"].path, capture, result, view)
        write_report(
            own["report.html"].path,
            capture,
            result,
            metrics=metrics,
            transport=light,
            view=view,
            timings=seconds,
            beside={"paper": beside},
            title=scene.name,
        )
    warnings = simulation_warnings(instrument, light) + capture_warnings(capture)
    warn(warnings)
    written = [*own, *pictures]
    if json:
        timings = {**seconds, **result.timings_s}
        report = {"folder": output, "files": written, "warnings": warnings}
        print_json(report | {"metrics": metrics, "paper": beside, "seconds": timings})
    else:
        print_errors(metrics)
        print_spots(beside, "paper")
        say(f"\nWrote {', '.join(written)} to {output}.")
        say(f"Look at it: {(output / 'report.html').resolve().as_uri()}")
