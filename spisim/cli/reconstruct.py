"""`spisim reconstruct`: the same as `python -m reconstruction`."""

from pathlib import Path
from typing import Annotated

import typer

from .options import CaptureArgument, Json

EXAMPLE = "spisim reconstruct foggy.h5 -o foggy"


def command(
    capture: CaptureArgument,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="A folder.")],
    frame: Annotated[int, typer.Option(min=0, help="Frame of the capture.")] = 0,
    json: Json = False,
) -> None:
    """Reconstruct image, ranges, depth map and point cloud of a capture, simulated or recorded."""
    from reconstruction.cli import main

    options = ["--output", str(output), "--frame", str(frame), *(["--json"] if json else [])]
    raise typer.Exit(main(["reconstruct", str(capture), *options]))
