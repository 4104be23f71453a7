"""Calibrate the throughput of patterns and the noise of a capture."""

import argparse
from dataclasses import replace
from pathlib import Path

from ..base.errors import InputError
from ..base.files import Output
from ..base.folders import output_files
from ..base.text import json_line, printable
from ..calibration import (
    calibrated,
    excess_noise,
    throughput_of,
    throughput_of_flat_field,
)
from ..capture import read_capture, write_capture

EXAMPLE = "python -m reconstruction calibrate scan.h5 --flat-field wall.h5 -o calibrated.h5"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    add = parser.add_argument
    add("capture", metavar="CAPTURE", type=Path, help="capture to calibrate")
    add("-o", "--output", metavar="FILE", type=Path, required=True, help="calibrated capture")
    source = parser.add_mutually_exclusive_group().add_argument
    source("--pairs", metavar="CAPTURE", type=Path, nargs="+", default=[], help="with its patterns")
    source("--flat-field", metavar="CAPTURE", type=Path, help="of a uniform scene")
    add("--repeat", metavar="CAPTURE", type=Path, help="of the same scene: shows excess noise")
    add("--overwrite", action="store_true", help="replace files that this command did not write")


def run(options: argparse.Namespace) -> None:
    """Write the capture with what it and other recordings say of its patterns."""
    others = [*options.pairs, options.flat_field, options.repeat]
    read = [options.capture, *(path for path in others if path is not None)]
    file = Output(options.output, "hardware capture", (".h5", ".hdf5"))
    with output_files([file], read, overwrite=options.overwrite):
        capture = read_capture(options.capture)
        report: dict[str, object] = {"written": str(options.output)}
        if options.repeat is not None:
            factor, error = excess_noise(capture, read_capture(options.repeat))
            stated = max(factor, 1.0) * capture.buckets.excess_noise_factor
            capture = replace(capture, buckets=replace(capture.buckets, excess_noise_factor=stated))
            report |= {"variance_over_stated": factor, "standard_error": error}
        if options.flat_field is None:
            recordings = [capture, *(read_capture(path) for path in options.pairs)]
            calibration = throughput_of(recordings)
        else:
            calibration = throughput_of_flat_field(read_capture(options.flat_field))
        if calibration is None and options.repeat is None:
            raise InputError(
                f"{options.capture}: noise explains the scatter of pairs; nothing to add"
            )
        if calibration is not None:
            capture = calibrated(capture, calibration)
            report["scatter"] = calibration.scatter
        write_capture(capture, options.output)
        figures = ", ".join(f"{name} {value:.3g}" for name, value in list(report.items())[1:])
        print(json_line(report) if options.json else printable(f"{options.output}: {figures}"))
