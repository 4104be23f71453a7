"""`spisim transport`: how much light comes back, before any detector."""

from pathlib import Path
from typing import Annotated

import typer

from .console import messages, print_json, progress_bar
from .inputs import instrument_with, scene_with
from .options import Bar, Clear, InstrumentOption, Json, SceneArgument, Seed, Spp, Visibility

EXAMPLE = "spisim transport warehouse -o warehouse.exr --clear"


def command(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="EXR", help="OpenEXR file.")],
    instrument: InstrumentOption = "paper",
    visibility: Visibility = None,
    clear: Clear = False,
    seed: Seed = 0,
    spp: Spp = 256,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Trace the light only: transport image and truth as channels of an OpenEXR file.

    The spots' light over path length goes into a NumPy file (.npz) beside it.
    """
    from reconstruction.files import require_file
    from spisim.transport import ground_truth, solve

    from .files import write_histogram, write_truth

    require_file(output)
    place, carried = scene_with(scene, visibility, clear), instrument_with(instrument)
    with progress_bar("Tracing light", progress) as advance:
        light = solve(place, carried, spp=spp, seed=seed, progress=advance)
    images = {"transport": light.image, "transport_error": light.image_error}
    write_truth(output, ground_truth(place, carried), images)
    histogram = output.with_suffix(".npz")
    write_histogram(histogram, light)
    if json:
        print_json(
            {
                "written": [output, histogram],
                "paths": light.paths,
                "seconds": light.seconds,
                "transport_mean": float(light.image.mean()),
            }
        )
    else:
        messages.print(
            f"Wrote {output} and {histogram}: {light.paths:,} paths in {light.seconds:.1f} s.",
            soft_wrap=True,
        )
