"""`spisim reconstruct`: `python -m reconstruction`, and a page about what came out."""

from pathlib import Path
from typing import Annotated

import typer

from .options import CaptureArgument, Json, number_option

EXAMPLE = "spisim reconstruct foggy.h5 -o foggy"


def command(
    capture: CaptureArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="A folder.")],
    frame: Annotated[int, number_option(0, 2**31, "Frame of the capture.")] = 0,
    patterns: Annotated[int | None, number_option(1, 2**31, "Use so many patterns only.")] = None,
    order: Annotated[str, typer.Option(help="... of this order.")] = "sequency-2d",
    json: Json = False,
) -> None:
    """Reconstruct image, ranges, depth map and point cloud of a capture, simulated or recorded.

    Writes report.html beside them.
    """
    from reconstruction import evaluate, first_patterns, read_capture, read_result
    from reconstruction.cli import main
    from spisim.report import write_report

    options = ["--output", str(output), "--frame", str(frame), *(["--json"] if json else [])]
    if patterns is not None:
        options += ["--patterns", str(patterns), "--order", order]
    if status := main(["reconstruct", str(capture), *options]):
        raise typer.Exit(status)
    recording = read_capture(capture)
    if patterns is not None:
        recording = first_patterns(recording, patterns, order)
    result = read_result(output / "result.h5")
    metrics = None if recording.truth is None else evaluate(result, recording)
    write_report(output / "report.html", recording, result, metrics=metrics, title=capture.stem)
