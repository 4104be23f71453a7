"""`spisim export`: `python -m reconstruction export`, with the poses of simulated captures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import print_json, progress_bar, results, say
from .inputs import captures_in
from .options import Bar, Json, Methods, Overwrite, StatedWeather

if TYPE_CHECKING:
    from reconstruction.exports import Shot

EXAMPLE = "spisim export flight -o flight.mcap"


def _list(wanted: bool) -> None:
    if wanted:
        from reconstruction.exports import EXPORTS

        results.print("\n".join(f"{name}: {form.title}" for name, form in EXPORTS.loadable()))
        raise typer.Exit


def command(
    captures: Annotated[
        list[Path],
        typer.Argument(
            metavar="CAPTURE...",
            help="Captures, the folder of a flight, or results (result.h5).",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="OUT", help="A folder, or FILE.mcap.")
    ],
    form: Annotated[
        str | None,
        typer.Option("--format", help="rgbd, nerf, pcd, mcap; without it as OUT ends, or rgbd."),
    ] = None,
    formats: Annotated[
        bool, typer.Option("--formats", callback=_list, is_eager=True, help="List all formats.")
    ] = False,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: StatedWeather = None,
    overwrite: Overwrite = False,
    json: Json = False,
    progress: Bar = None,
) -> None:
    """Reconstruct captures, and write images, depth and ranges for other programs.

    Poses of simulated captures are those of the drone in the scene. For poses of recordings from a
    file, use python -m reconstruction export --poses.
    """
    from reconstruction.cli.reconstruct import names
    from reconstruction.exports import (
        check_export,
        export_format,
        frames_in,
        shots_of,
        write_export,
    )
    from spisim.dataset.poses import placed

    chosen = export_format(form, output)
    files = captures_in(captures)
    check_export(chosen, output, files, overwrite=overwrite)
    frames = frames_in(files)
    methods = {"image": names(image), "ranging": names(ranging), "depth": names(depth)}
    shots = shots_of(files, placed, methods, weather)
    with progress_bar(f"Exporting {frames} frames", progress) as advance:
        write_export(chosen, _counted(shots, frames, advance), output)
    if json:
        print_json({"written": output, "frames": frames})
    else:
        say(f"Wrote {frames} frames to {output}.")


def _counted(
    shots: Iterable[Shot], frames: int, advance: Callable[[float], None]
) -> Iterator[Shot]:
    for number, shot in enumerate(shots, 1):
        yield shot
        advance(number / frames)
