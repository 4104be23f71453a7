"""`spisim evaluate`: reconstruction against truth."""

from pathlib import Path
from typing import Annotated

import typer

from .console import print_json
from .options import CaptureArgument, Json
from .tables import print_errors

EXAMPLE = "spisim evaluate out/demo/capture.h5 out/demo"


def command(
    capture: CaptureArgument,
    folder: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="What `reconstruct` wrote.")
    ] = None,
    json: Json = False,
) -> None:
    """Compare image, ranges and depth map with the truth of a simulated capture.

    Without the folder of a result, the capture is reconstructed first.
    """
    from reconstruction import InputError, evaluate, read_capture, read_result, reconstruct

    recording = read_capture(capture)
    if recording.truth is None:
        raise InputError(f"{capture} holds no truth to compare with; simulated captures do")
    result = reconstruct(recording) if folder is None else read_result(folder / "result.h5")
    if result.image.shape != recording.plan.shape:
        raise InputError(f"{folder} is no result of {capture}: their image sizes differ")
    metrics = evaluate(result, recording.truth)
    if json:
        print_json(metrics)
    else:
        print_errors(metrics)
