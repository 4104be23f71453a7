"""Array of bucket readings -> capture."""

import argparse
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..capture import write_capture
from ..capture.importers import capture_from_readings, load_array, plan_from_matrix
from ..errors import naming
from ..files import Output, require_outputs
from ..operators import ORDERS, POLARITIES, make_plan
from ..text import printable

OVERWRITE = "replace files that this command did not write, too"
EXAMPLE = (
    "python -m reconstruction import car.mat -o car.h5 --shape 32x32 --variable data "
    "--patterns-variable vecs --untrusted 0"
)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Options of this command."""
    parser.add_argument("file", metavar="FILE", type=Path, help=".mat, .npy, .npz or .csv")
    parser.add_argument("-o", "--output", metavar="CAPTURE", type=Path, required=True, help="file")
    parser.add_argument("--shape", type=_shape, required=True, help="rows x columns, as in 32x32")
    parser.add_argument("--variable", help="the readings' variable in a .mat or .npz")
    parser.add_argument(
        "--patterns-variable",
        help="variable with the patterns (M, N), any at all; replaces the next three",
    )
    parser.add_argument("--order", default="natural", help=", ".join(ORDERS))
    parser.add_argument("--polarity", default="signed", help=", ".join(POLARITIES))
    parser.add_argument("--patterns", metavar="K", type=int, help="number of patterns (all)")
    parser.add_argument(
        "--untrusted", metavar="I", type=int, nargs="+", default=[], help="readings not to be used"
    )
    parser.add_argument("--overwrite", action="store_true", help=OVERWRITE)


def run(options: argparse.Namespace) -> None:
    """Import a recording."""
    file = Output(options.output, "hardware capture", (".h5", ".hdf5"))
    require_outputs([file], [options.file], overwrite=options.overwrite)
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
    told = f"{options.output}: {capture.frames} frame(s) of {plan.exposures} readings"
    print(printable(told))


def _shape(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)x(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form 32x32 (rows x columns)")
    return int(match[1]), int(match[2])
