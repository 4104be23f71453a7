"""The command line: reconstruct a capture, import a recording."""

import argparse
import json
import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from .capture import Capture, read_capture, write_capture
from .errors import InputError, explain, naming
from .files import require_file, require_folder
from .findings import capture_warnings
from .importers import capture_from_readings, load_array, plan_from_matrix
from .outputs import write_outputs
from .patterns import ORDERS, POLARITIES, make_plan
from .pipeline import Result, reconstruct
from .ranging import Ranges
from .selection import first_patterns

COMMANDS = ("reconstruct", "import")


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command; the exit status is 0, or 2 for bad input and files that cannot be written."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if arguments and not arguments[0].startswith("-") and arguments[0] not in COMMANDS:
        arguments.insert(0, "reconstruct")
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except InputError as error:
        return _fail(str(error))
    except OSError as error:
        return _fail(explain(error))
    return 0


def _fail(message: str) -> int:
    print(f"error: {message}", file=sys.stderr)
    return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m reconstruction",
        description="From a capture to image, ranges and depth map.",
        epilog="A capture as the first word means reconstruct.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    run = commands.add_parser(
        "reconstruct",
        help="capture -> image, ranges, depth map, point cloud",
        epilog="example: python -m reconstruction capture.h5 -o result",
    )
    run.add_argument("capture", metavar="CAPTURE", type=Path, help="capture file")
    run.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="folder")
    run.add_argument("--frame", type=int, default=0, help="frame of the capture (0)")
    run.add_argument("--patterns", metavar="K", type=int, help="use the first K patterns only")
    run.add_argument("--order", default="sequency-2d", help=f"... of this order: {_list(ORDERS)}")
    run.add_argument("--json", action="store_true", help="print one JSON object")
    run.set_defaults(run=_reconstruct)

    load = commands.add_parser(
        "import",
        help="array of bucket readings -> capture",
        epilog="example: python -m reconstruction import car.mat -o car.h5 --shape 32x32 "
        "--variable data --patterns-variable vecs --untrusted 0",
    )
    load.add_argument("file", metavar="FILE", type=Path, help=".mat, .npy, .npz or .csv")
    load.add_argument("-o", "--output", metavar="CAPTURE", type=Path, required=True, help="file")
    load.add_argument("--shape", type=_shape, required=True, help="rows x columns, as in 32x32")
    load.add_argument("--variable", help="the readings' variable in a .mat or .npz")
    load.add_argument(
        "--patterns-variable",
        help="variable with the patterns (M, N), identified row by row; replaces the next three",
    )
    load.add_argument("--order", default="natural", help=_list(ORDERS))
    load.add_argument("--polarity", default="signed", help=_list(POLARITIES))
    load.add_argument("--patterns", metavar="K", type=int, help="number of patterns (all)")
    load.add_argument(
        "--untrusted", metavar="I", type=int, nargs="+", default=[], help="readings not to be used"
    )
    load.set_defaults(run=_import)
    return parser


def _reconstruct(options: argparse.Namespace) -> None:
    require_folder(options.output)
    recording = capture = read_capture(options.capture)
    with naming(options.capture):
        if options.patterns is not None:
            capture = first_patterns(recording, options.patterns, options.order)
        result = reconstruct(capture, options.frame)
    # However many of its patterns are used, it is a result of this recording.
    result = replace(result, recording=recording.digest)
    files = write_outputs(result, capture, options.output)
    warnings = capture_warnings(capture, options.frame)
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
    if options.json:
        written = {name: str(path) for name, path in files.items()}
        report = _report(result, capture) | {"warnings": warnings, "files": written}
        print(json.dumps(report, allow_nan=False))
    else:
        _print_tables(result, capture, files)


def _import(options: argparse.Namespace) -> None:
    require_file(options.output)
    readings = load_array(options.file, options.variable)
    if options.patterns_variable is None:
        plan = make_plan(options.shape, options.patterns, options.order, options.polarity)
        sign = np.ones(plan.exposures, np.int8)
    else:
        matrix = load_array(options.file, options.patterns_variable)
        with naming(options.file):
            plan, sign = plan_from_matrix(matrix, options.shape)
    with naming(options.file):
        capture = capture_from_readings(readings, plan, options.untrusted)
    buckets = capture.buckets
    capture = replace(capture, buckets=replace(buckets, counts=buckets.counts * sign))
    write_capture(capture, options.output)
    print(f"{options.output}: {capture.frames} frame(s) of {plan.exposures} readings")


def _report(result: Result, capture: Capture) -> dict[str, Any]:
    plan, ranges = capture.plan, result.ranges
    spots = (
        [] if ranges is None else zip(ranges.range_m, ranges.sigma_m, ranges.status, strict=True)
    )
    return {
        "source": capture.provenance.source,
        "shape": list(plan.shape),
        "patterns": plan.sampled,
        "pixels": plan.pixels,
        "sampling_ratio": plan.sampling_ratio,
        "spots": [
            {
                "range_m": float(range_m) if status == "ok" else None,
                "sigma_m": float(sigma_m) if status == "ok" else None,
                "status": status,
            }
            for range_m, sigma_m, status in spots
        ],
        "depth": result.depth_m is not None,
        "dense_coverage": _coverage(result),
        "timings_s": result.timings_s,
    }


def _print_tables(result: Result, capture: Capture, files: dict[str, Path]) -> None:
    plan = capture.plan
    console = Console(highlight=False, markup=False, emoji=False)
    console.print(
        f"{plan.shape[0]} x {plan.shape[1]} pixels from {plan.sampled} patterns "
        f"({100 * plan.sampling_ratio:.1f} %), {capture.provenance.source}"
    )
    if result.ranges is not None:
        console.print(_range_table(result.ranges))
        if result.depth_m is None:
            console.print("no depth map: no spot has a range, or the optics are not known")
    elif capture.pattern_taps is None:
        console.print("no time of flight in this capture: image only, no ranges, no depth map")
    coverage = _coverage(result)
    if coverage is not None:
        console.print(f"dense ranges: {100 * coverage:.1f} % of all pixels have one")
    stages = ", ".join(
        f"{name} {1e3 * seconds:.1f} ms" for name, seconds in result.timings_s.items()
    )
    console.print(stages)
    for path in files.values():
        console.print(f"wrote {path}", soft_wrap=True)


def _range_table(ranges: Ranges) -> Table:
    table = Table("spot", "range / m", "sigma / m", "signal / electrons", "background / electrons")
    for spot, status in enumerate(ranges.status):
        table.add_row(
            str(spot),
            f"{ranges.range_m[spot]:.3f}" if status == "ok" else status,
            f"{ranges.sigma_m[spot]:.3f}" if status == "ok" else "",
            f"{ranges.signal_electrons[spot]:.4g}",
            f"{ranges.background_electrons[spot]:.4g}",
        )
    return table


def _coverage(result: Result) -> float | None:
    """Share of the pixels that have a dense range."""
    if result.range_dense_m is None:
        return None
    return float(np.isfinite(result.range_dense_m).mean())


def _shape(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form 32x32 (rows x columns)")
    return int(match[1]), int(match[2])


def _list(names: Sequence[str]) -> str:
    return ", ".join(names)
