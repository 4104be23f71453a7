"""Reconstruct a capture: image, ranges, depth map, point cloud."""

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from shutil import get_terminal_size
from typing import Any

import numpy as np

from ..base.errors import InputError, naming
from ..base.folders import output_folder
from ..base.text import json_line, printable, shortened
from ..capture import Capture, check_frames, first_patterns, open_capture
from ..chosen_methods import left_out, warm_up_frames
from ..depth import DEPTH_METHODS, DISTANCES_M, MAX_RANGE_M, MIN_FREE, check_min_free
from ..diagnostics import capture_warnings
from ..evaluation import method_title, no_range
from ..image import DICTIONARIES, IMAGE_METHODS
from ..operators import ORDERS
from ..outputs import outputs_in, write_outputs
from ..ranging import RANGED, RANGING_METHODS, Ranges
from ..reconstructor import reconstruct
from ..result import Result

ANY_WIDTH = 10_000
"""Line width if the output is no terminal."""
WEATHER = "weather assumed for ranges: clear, fog, unknown, or a visibility in metres"
OVERWRITE = "replace files that this command did not write, too"
EXAMPLE = "python -m reconstruction capture.h5 -o result"
STATIONS: dict[str, Iterable[str]] = {
    "image": IMAGE_METHODS,
    "ranging": RANGING_METHODS,
    "depth": DEPTH_METHODS,
}
MIN_FREE_OPTION: dict[str, Any] = {
    "metavar": "P",
    "type": float,
    "default": MIN_FREE,
    "help": f"the corridor ends where it is free with a probability below P ({MIN_FREE:g})",
}
DETAILS = {"image": f"; of pursuits, pursuit:NAME has the dictionary {' or '.join(DICTIONARIES)}"}


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    add = parser.add_argument
    add("capture", metavar="CAPTURE", type=Path, help="capture file")
    add("-o", "--output", metavar="DIR", type=Path, required=True, help="folder")
    add("--frame", type=int, default=0, help="frame of the capture (0)")
    add("--patterns", metavar="K", type=int, help="use the first K patterns only")
    add("--order", help=f"... of this order, or the basis' usual one: {', '.join(ORDERS)}")
    for station, methods in STATIONS.items():
        add(
            f"--{station}",
            metavar="METHOD[,METHOD]",
            help=f"methods, the default one first: usual, all, {', '.join(methods)}"
            + DETAILS.get(station, ""),
        )
    add("--weather", metavar="WEATHER", help=WEATHER)
    add("--min-free", **MIN_FREE_OPTION)
    add("--overwrite", action="store_true", help=OVERWRITE)


def run(options: argparse.Namespace) -> None:
    """Reconstruct a capture."""
    outputs = outputs_in(options.output)
    with output_folder(options.output, outputs, [options.capture], overwrite=options.overwrite):
        reconstruct_into_folder(options)


def reconstruct_into_folder(options: argparse.Namespace) -> None:
    """Write the files of a capture into a locked folder, and report."""
    check_min_free(options.min_free)
    if options.order is not None and options.patterns is None:
        raise InputError("--order needs --patterns")
    methods = {name: names(getattr(options, name)) for name in STATIONS}
    with open_capture(options.capture) as file:
        check_frames(options.frame, options.frame + 1, file.frames)
        warm_up = warm_up_frames(file.setup, options.frame, **methods)
        recording = capture = file.capture(options.frame - warm_up, options.frame + 1)
    with naming(options.capture):
        if options.patterns is not None:
            capture = first_patterns(recording, options.patterns, options.order)
        result = reconstruct(
            capture, warm_up, **methods, weather=options.weather, min_free=options.min_free
        )
    # The digest is that of the whole recording, however many of its patterns are used.
    digest = recording.frame(warm_up).digest(recording.setup)
    result = replace(result, frame=options.frame, recording=digest)
    files = write_outputs(result, capture, options.output)
    warnings = capture_warnings(capture, warm_up, result.ranges)
    warnings += result.warnings
    for warning in warnings:
        print(printable(shortened(f"warning: {warning}")), file=sys.stderr)
    unsuited = left_out(capture.setup) if methods["depth"] is None else {}
    if options.json:
        written = {name: str(path) for name, path in files.items()}
        report = _report(result, capture) | {"depths_left_out": unsuited}
        print(json_line(report | {"warnings": warnings, "files": written}))
    else:
        for line in _lines(result, capture, unsuited, files):
            print(printable(line))


def names(text: str | None) -> Sequence[str] | None:
    """Method names as `Reconstructor` takes them, from an option's text."""
    return None if text is None else [name.strip() for name in text.split(",")]


def _report(result: Result, capture: Capture) -> dict[str, Any]:
    plan = capture.plan
    return {
        "source": capture.provenance.source,
        "frame": result.frame,
        "shape": list(plan.shape),
        "patterns": plan.sampled,
        "pixels": plan.pixels,
        "sampling_ratio": plan.sampling_ratio,
        "images": list(result.images),
        "spots": {name: _spots(ranges) for name, ranges in result.rangings.items()},
        "visibility": None if result.visibility is None else result.visibility.numbers,
        "depth_coverage": _coverage(result),
        "obstacles_m": {
            name: None if np.isnan(each) else each for name, each in result.obstacles_m.items()
        },
        "min_free": result.min_free,
        "free_distance_m": DISTANCES_M.round(4).tolist(),
        "free_probabilities": {
            name: free.round(4).tolist() for name, free in result.free_probabilities.items()
        },
        "timings_s": dict(result.timings_s),
    }


def _spots(ranges: Ranges) -> list[dict[str, Any]]:
    return [
        {
            "range_m": float(range_m) if status in RANGED else None,
            "sigma_m": float(sigma_m) if status in RANGED else None,
            "status": status,
            "alternatives": [each._asdict() for each in alternatives],
        }
        for range_m, sigma_m, status, alternatives in zip(
            ranges.range_m, ranges.sigma_m, ranges.status, ranges.alternatives, strict=True
        )
    ]


def _coverage(result: Result) -> dict[str, float]:
    """Fraction of the pixels with a depth, by method."""
    return {name: float(np.isfinite(depth).mean()) for name, depth in result.depths.items()}


def _lines(
    result: Result, capture: Capture, unsuited: dict[str, str], files: dict[str, Path]
) -> Iterator[str]:
    plan = capture.plan
    if plan.shows_image:
        yield (
            f"{plan.shape[0]} x {plan.shape[1]} pixels from {plan.sampled} patterns "
            f"({100 * plan.sampling_ratio:.1f} %), {capture.provenance.source}"
        )
    else:
        yield f"ranges alone, {capture.provenance.source}: no patterns, no image"
    for name, ranges in result.rangings.items():
        yield from _range_lines(name, ranges)
    if result.visibility is not None:
        yield f"visibility (2 % contrast): {result.visibility}"
    if not result.rangings and not result.depths:
        yield "no time of flight in this capture: image only, no ranges, no depth map"
    elif not result.depths:
        yield "no depth map: no spot has a range, or the optics are unknown"
    for name, why in unsuited.items():
        yield f"depth, {method_title('depths', name)}: not for this recording ({why})"
    for name, fraction in _coverage(result).items():
        ahead = _ahead(result.obstacles_m.get(name), result.min_free)
        yield f"depth, {method_title('depths', name)}: {100 * fraction:.1f} % of all pixels{ahead}"
    yield ", ".join(f"{stage} {1e3 * s:.1f} ms" for stage, s in result.timings_s.items())
    for path in files.values():
        yield f"wrote {path}"


def _ahead(obstacle_m: float | None, min_free: float) -> str:
    if obstacle_m is None:
        return ""
    free_m = MAX_RANGE_M if np.isnan(obstacle_m) else obstacle_m
    return f", free ahead up to {free_m:.2f} m with a probability of {min_free:g}"


def _range_lines(name: str, ranges: Ranges) -> Iterable[str]:
    columns = ("range / m", "sigma / m", "signal / electrons", "background / electrons", "status")
    rows = [(name, *columns)]
    for spot, status in enumerate(ranges.status):
        ranged = status in RANGED
        others = ranges.alternatives[spot]
        rows.append(
            (
                f"spot {spot}",
                f"{ranges.range_m[spot]:.3f}" if ranged else no_range(status, others),
                f"{ranges.sigma_m[spot]:.3f}" if ranged else "",
                f"{ranges.signal_electrons[spot]:.4g}",
                f"{ranges.background_electrons[spot]:.4g}",
                status,
            )
        )
    return _aligned(rows)


def _aligned(rows: Sequence[Sequence[str]]) -> Iterable[str]:
    """Align columns, the first to the left; print too wide tables row by row."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    if sum(widths) + 2 * (len(widths) - 1) > get_terminal_size(fallback=(ANY_WIDTH, 24)).columns:
        (title, *columns), *rows = rows
        for first, *others in rows:
            yield f"{title}: {first}"
            yield from (f"  {name}: {cell}" for name, cell in zip(columns, others, strict=True))
        return
    for first, *others in rows:
        cells = (cell.rjust(width) for cell, width in zip(others, widths[1:], strict=True))
        yield "  ".join([first.ljust(widths[0]), *cells])
