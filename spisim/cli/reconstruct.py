"""`spisim reconstruct`: `python -m reconstruction`, and a page about what came out."""

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
    patterns: Annotated[int | None, number_option(1, 2**31, "Use so many patterns only.")] = None,
    order: Annotated[str | None, typer.Option(help="... of this order.")] = None,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: StatedWeather = None,
    min_free: MinFree = None,
    overwrite: Overwrite = False,
    json: Json = False,
) -> None:
    """Reconstruct image, ranges, depth map and point cloud of a capture, simulated or recorded.

    Writes report.html beside them. Methods of image, ranging and depth are chosen by name, several
    with commas between, the default one first, or all.
    """
    from reconstruction import evaluate, first_patterns, read_capture, read_result
    from reconstruction.cli import main
    from reconstruction.files import require_outputs
    from spisim.report.capture import write_report

    page = output / "report.html"
    require_outputs([named(page, "capture report")], [capture], overwrite=overwrite)
    options = ["--output", str(output), "--frame", str(frame), *(["--json"] if json else [])]
    options += ["--overwrite"] if overwrite else []
    for station, names in {"image": image, "ranging": ranging, "depth": depth}.items():
        options += [] if names is None else [f"--{station}", names]
    changes = {"patterns": patterns, "order": order, "weather": weather, "min-free": min_free}
    for name, value in changes.items():
        options += [] if value is None else [f"--{name}", str(value)]
    if status := main(["reconstruct", str(capture), *options]):
        raise typer.Exit(status)
    recording = read_capture(capture)
    result = read_result(output / "result.h5")
    known = recording.truth is not None and recording.truth.knows(frame)
    metrics = evaluate(result, recording) if known else None
    if patterns is not None:
        recording = first_patterns(recording, patterns, order)
    write_report(page, recording, result, metrics=metrics, title=capture.stem)
