"""`spisim evaluate`: reconstruction against truth."""

from pathlib import Path
from typing import Annotated

import typer

from reconstruction.base.errors import naming

from .console import print_json, warn
from .options import CaptureArgument, FrameOption, Json, Methods, MinFree, StatedWeather
from .tables import print_errors, print_recording

EXAMPLE = "spisim evaluate out/demo/capture.h5 out/demo"


def command(
    capture: CaptureArgument,
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="What `reconstruct` wrote.")
    ] = None,
    frame: FrameOption = 0,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: StatedWeather = None,
    min_free: MinFree = None,
    json: Json = False,
) -> None:
    """Compare image, ranges and depth map with the truth of a simulated capture.

    Without the folder of a result, a frame is reconstructed first by the given methods. For a
    recording without truth, report the repeatability of its frames: noise against the expected
    noise, saturation, and spread of ranges.
    """
    from dataclasses import replace

    from reconstruction import (
        InputError,
        capture_warnings,
        evaluate,
        read_capture,
        read_result,
        reconstruct,
    )
    from reconstruction.cli.reconstruct import names
    from reconstruction.depth import check_min_free
    from reconstruction.diagnostics import result_warnings
    from reconstruction.evaluation import evaluate_recording

    recording = read_capture(capture)
    if recording.truth is None and folder is None:
        with naming(capture):
            repeatability = evaluate_recording(recording, names(ranging), weather=weather)
        warnings = capture_warnings(recording, frame)
        warn(warnings)
        if json:
            print_json(repeatability | {"warnings": warnings})
        else:
            print_recording(repeatability)
        return
    file = None
    if folder is None:
        with naming(capture):
            result = reconstruct(
                recording,
                frame,
                image=names(image),
                ranging=names(ranging),
                depth=names(depth),
                weather=weather,
            )
    else:
        if weather is not None:
            raise InputError(f"--weather is only for a reconstruction; {folder} holds a result")
        file = folder / "result.h5"
        result = read_result(file)
    if min_free is not None:
        check_min_free(min_free)
        result = replace(result, min_free=min_free)
    with naming(capture if file is None else f"{file} for {capture}"):
        metrics = evaluate(result, recording)
    warnings = result_warnings(result, recording)
    warn(warnings)
    if json:
        print_json(metrics | {"warnings": warnings})
    else:
        print_errors(metrics)
