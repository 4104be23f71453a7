"""`spisim reconstruct`: `python -m reconstruction`, and a page about the result."""

from argparse import Namespace
from pathlib import Path
from typing import Annotated

import typer

from .options import (
    CaptureArgument,
    FrameOption,
    Json,
    Methods,
    MinFree,
    Overwrite,
    StatedWeather,
    number_option,
)
from .outputs import output as named

EXAMPLE = "spisim reconstruct foggy.h5 -o foggy"


def command(
    capture: CaptureArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="A folder.")],
    frame: FrameOption = 0,
    patterns: Annotated[int | None, number_option(1, 2**31, "Use only this many patterns,")] = None,
    order: Annotated[str | None, typer.Option(help="... in this order.")] = None,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: StatedWeather = None,
    min_free: MinFree = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Reconstruct image, ranges, depth map and point cloud of a simulated or recorded capture.

    Writes report.html beside them. Select methods of image, ranging and depth by name, separated by
    commas with the default one first, or all.
    """
    from reconstruction import evaluate, first_patterns, read_capture, read_result
    from reconstruction.base.folders import output_folder
    from reconstruction.cli.reconstruct import reconstruct_into_folder
    from reconstruction.depth import MIN_FREE
    from reconstruction.outputs import outputs_in
    from spisim_app.report.capture import write_report

    page = output / "report.html"
    options = Namespace(
        capture=capture,
        output=output,
        frame=frame,
        patterns=patterns,
        order=order,
        image=image,
        ranging=ranging,
        depth=depth,
        weather=weather,
        min_free=MIN_FREE if min_free is None else min_free,
        json=json,
    )
    files = [*outputs_in(output), named(page, "capture report")]
    with output_folder(output, files, [capture], overwrite=overwrite):
        reconstruct_into_folder(options)
        recording = read_capture(capture)
        result = read_result(output / "result.h5")
        valid = recording.truth is not None and recording.truth.knows(frame)
        metrics = evaluate(result, recording) if valid else None
        if patterns is not None:
            recording = first_patterns(recording, patterns, order)
        write_report(page, recording, result, metrics=metrics, title=capture.stem)
