"""Export captures to files of other programs."""

import argparse
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from ..base.errors import InputError
from ..base.text import json_line, printable
from ..capture import CaptureFile
from ..exports import (
    DEFAULT_EXPORT,
    EXPORTS,
    PoseSource,
    Shot,
    TimestampedPose,
    check_export,
    export_format,
    frames_in,
    read_poses,
    shots_of,
    write_export,
)
from .reconstruct import OVERWRITE, STATIONS, WEATHER, names

EXAMPLE = "python -m reconstruction export flight.h5 -o flight.mcap"
PROGRESS_EVERY_S = 5.0


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    add = parser.add_argument
    add("captures", metavar="CAPTURE", type=Path, nargs="+", help="capture, or result.h5")
    add("-o", "--output", metavar="OUT", type=Path, required=True, help="folder, or FILE.mcap")
    add(
        "--format",
        help=f"{', '.join(EXPORTS)}; default: by the extension of OUT, else {DEFAULT_EXPORT}",
    )
    add(
        "--poses",
        metavar="FILE",
        type=Path,
        help="time and pose of the optical frame per frame: timestamp tx ty tz qx qy qz qw (TUM)",
    )
    for station, methods in STATIONS.items():
        add(f"--{station}", metavar="METHOD", help=f"method: {', '.join(methods)}")
    add("--weather", metavar="WEATHER", help=WEATHER)
    add("--overwrite", action="store_true", help=OVERWRITE)


def run(options: argparse.Namespace) -> None:
    """Export captures, with the poses of a file or without."""
    form = export_format(options.format, options.output)
    inputs = [*options.captures, *([] if options.poses is None else [options.poses])]
    check_export(form, options.output, inputs, overwrite=options.overwrite)
    frames = frames_in(options.captures)
    pose_source = _no_pose if options.poses is None else _in_turn(options.poses, frames)
    methods = {name: names(getattr(options, name)) for name in STATIONS}
    shots = shots_of(options.captures, pose_source, methods, options.weather)
    write_export(form, _with_progress(shots, frames), options.output)
    if options.json:
        print(json_line({"written": str(options.output), "frames": frames}))
    else:
        print(printable(f"wrote {frames} frame(s) to {options.output}"))


def _no_pose(capture: CaptureFile | None, frame: int) -> None:
    """No pose is known."""


def _in_turn(file: Path, frames: int) -> PoseSource:
    poses = read_poses(file)
    if len(poses) != frames:
        raise InputError(f"{file} has {len(poses)} poses for {frames} frames; one each is needed")
    rows: Iterator[TimestampedPose] = iter(poses)
    return lambda capture, frame: next(rows)


def _with_progress(shots: Iterable[Shot], frames: int) -> Iterator[Shot]:
    printed_s = time.monotonic()
    for number, shot in enumerate(shots):
        if number and time.monotonic() - printed_s > PROGRESS_EVERY_S:
            printed_s = time.monotonic()
            print(f"{number} of {frames} frames", file=sys.stderr)
        yield shot
