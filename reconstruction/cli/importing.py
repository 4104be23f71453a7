"""Import arrays of bucket and time-of-flight readings as captures."""

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, naming
from ..base.files import Output
from ..base.folders import output_files
from ..base.text import json_line, printable
from ..capture import Capture, Spots, write_capture
from ..capture.importers import (
    ABOUT,
    PHASE_STEPS,
    READERS,
    added,
    capture_from_readings,
    capture_from_spots,
    frames_of_columns,
    half_plane,
    load_array,
    parts,
    plan_from_coefficients,
    plan_from_factors,
    plan_from_matrix,
    plan_from_phase_steps,
    plan_from_rows,
    program_of,
    read_about,
    readings_of,
)
from ..diagnostics import capture_warnings
from ..image import WITHOUT_DARK, Candidate, dark_estimate, recognise
from ..operators import ORDERS, POLARITIES, PatternPlan, decoder_for, make_plan, transposed
from . import taps
from .numbers import band, number, shape

OVERWRITE = "replace files that this command did not write, too"
EXAMPLE = (
    "python -m reconstruction import car.mat -o car.h5 --shape 32x32 --variable data "
    "--order auto --untrusted 0"
)
MIN_SURE = 0.95
"""Probability of a layout below which a warning is printed."""
MIN_TAPS = 16
"""Four taps of four spots: images of as few pixels are rare."""
PATTERNS = ("patterns_variable", "factors", "rows", "frequencies", "order", "polarity", "patterns")
"""Options that state the exposed patterns."""
MAX_CANDIDATES, MIN_PROBABILITY = 3, 1e-3
"""Maximum number of printed layouts, and their minimum probability."""


class Recording(NamedTuple):
    """Readings, their plan, and each reading's sign."""

    readings: NDArray[Any]
    plan: PatternPlan
    sign: NDArray[np.int8] | int = 1


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    add = parser.add_argument
    kinds = ", ".join(READERS)
    add(
        "file",
        metavar="FILE",
        type=Path,
        nargs="?",
        help=f"readings of patterns: {kinds}, or NAME_spectraldata.npz of SPAS",
    )
    add("-o", "--output", metavar="CAPTURE", type=Path, required=True, help="file")
    add("--shape", type=shape, help="rows x columns, as in 32x32; not needed for SPAS")
    add("--variable", help="the readings' variable in a .mat or .npz, or column of a text, from 0")
    _add_patterns(parser)
    add("--transposed", action="store_true", help="pixels are numbered column by column")
    add("--dark", metavar="COUNTS", type=number, help="the dark reading, where none was recorded")
    add("--untrusted", metavar="I", type=int, nargs="+", default=[], help="readings to ignore")
    add("--band-nm", metavar="LOW-HIGH", type=band, help="wavelengths of SPAS to sum (all)")
    add("--about", metavar="YAML", type=Path, help="file of lines like electrons_per_count: 12.5")
    for name in ABOUT:
        add(f"--{name.replace('_', '-')}", metavar="X", type=number)
    taps.add_options(parser)
    add("--overwrite", action="store_true", help=OVERWRITE)


def _add_patterns(parser: argparse.ArgumentParser) -> None:
    """Add options that state the patterns; sources are variables, columns, or other files."""
    add = parser.add_argument
    one_of = parser.add_mutually_exclusive_group().add_argument
    one_of("--patterns-variable", metavar="SOURCE", help="patterns (M, N), any at all")
    one_of(
        "--factors", metavar="SOURCE,SOURCE", help="patterns down (A, H) and along (B, W) the image"
    )
    one_of("--rows", metavar="SOURCE", help="numbers of Hadamard rows, counted in the order")
    one_of("--frequencies", metavar="SOURCE", help="of Fourier patterns, (K, 2): down and along")
    add("--first-row", type=int, choices=(0, 1), default=0, help="number of the first row (0)")
    add("--signs", metavar="SOURCE", help="polarity of each reading, with --rows: 1, -1 or 0")
    add("--phase-steps", type=int, choices=PHASE_STEPS, help="of Fourier patterns, each in turn")
    add("--order", help=f"auto, {', '.join(ORDERS)} (natural)")
    add("--polarity", help=f"{', '.join(POLARITIES)} (signed)")
    add("--patterns", metavar="K", type=int, help="number of patterns (all)")


def run(options: argparse.Namespace) -> None:
    """Import a recording."""
    file = Output(options.output, "hardware capture", (".h5", ".hdf5"))
    read = [path for path in (options.file, options.about, options.taps_about) if path is not None]
    with output_files([file], read, overwrite=options.overwrite):
        spots = taps.spots_of(options, partial(_source, options))
        if options.file is not None:
            capture = _of_patterns(options, spots)
        elif spots is not None:
            capture = capture_from_spots(spots)
        else:
            raise InputError("FILE is missing: readings of patterns; use --taps for spots alone")
        write_capture(capture, options.output)
        warnings = [*taps.notes_of(options), *capture_warnings(capture, 0)]
        for warning in warnings:
            print(printable(f"warning: {warning}"), file=sys.stderr)
        if options.json:
            report = {"written": str(options.output), **_report(capture), "warnings": warnings}
            print(json_line(report))
        else:
            print(printable(f"{options.output}: {capture.frames} frame(s) of {_parts(capture)}"))


def _report(capture: Capture) -> dict[str, Any]:
    plan, spots = capture.plan, capture.spots
    return {
        "frames": capture.frames,
        "shape": list(plan.shape) if plan.shows_image else None,
        "exposures": plan.exposures if plan.shows_image else 0,
        "order": plan.order if plan.shows_image else None,
        "time_of_flight": None if spots is None else spots.method,
    }


def _parts(capture: Capture) -> str:
    """Description of a capture's frames."""
    parts = [f"{capture.plan.exposures} readings"] if capture.plan.shows_image else []
    parts += [] if capture.spots is None else [capture.spots.summary]
    return ", ".join(parts)


def _of_patterns(options: argparse.Namespace, spots: Spots | None) -> Capture:
    """Capture of bucket readings, and those of the spots, if any."""
    about: dict[str, float] = {}
    if (program := program_of(options.file)) is not None:
        readings, plan, about, own_spots = program.load(options.file, options.band_nm)
        recording, spots = Recording(readings, plan), own_spots if spots is None else spots
    else:
        recording = _recording(options)
    if options.about is not None:
        about |= read_about(options.about)
    about |= {name: value for name in ABOUT if (value := getattr(options, name)) is not None}
    plan = recording.plan
    with naming(options.file):
        if plan.shows_image and plan.patterns.orthogonal:
            try:
                decoder_for(plan)
            except InputError as error:  # the background is unknown
                raise InputError(f"{error}; or state the dark reading with --dark COUNTS") from None
        readings = readings_of(recording.readings, plan.exposures)
        capture = capture_from_readings(
            readings,
            plan,
            options.untrusted,
            about,
            spots=None if spots is None else added(spots, len(readings)),
            optics=taps.optics_of(options),
        )
        buckets = capture.buckets
        counts = buckets.counts * recording.sign
        return replace(capture, buckets=replace(buckets, counts=counts))


def _recording(options: argparse.Namespace) -> Recording:
    """Readings of a file, and their plan by the options."""
    if options.shape is None:
        raise InputError(
            "--shape is missing: rows x columns of the patterns, as in 32x32 (readings of spots: "
            "--taps)"
        )
    readings = load_array(options.file, options.variable, complex_too=True)
    _ask_about_taps(options, readings)
    shape = options.shape[::-1] if options.transposed else options.shape
    with naming(options.file):
        if np.iscomplexobj(readings):
            result = _of_coefficients(options, readings, shape)
        elif options.frequencies is not None:
            result = _of_phase_steps(options, readings, shape)
        elif options.patterns_variable is not None:
            plan, sign = plan_from_matrix(_source(options, options.patterns_variable), shape)
            readings, plan = _with_dark(options, readings, plan)
            result = Recording(readings, plan, np.append(sign, [1] * (plan.exposures - len(sign))))
        elif options.factors is not None:
            result = _of_factors(options, readings)
        elif options.rows is not None:
            result = _of_rows(options, readings, shape)
        elif options.order == "auto":
            result = _recognised(options, readings, shape)
        else:
            order, polarity = options.order or "natural", options.polarity or "signed"
            plan = make_plan(shape, options.patterns, order, polarity)
            result = Recording(*_with_dark(options, readings, plan))
        plan = transposed(result.plan) if options.transposed else result.plan
        if plan.shape != options.shape:
            raise InputError(
                f"the patterns have {plan.shape[0]} x {plan.shape[1]} pixels, not the "
                f"{options.shape[0]} x {options.shape[1]} of --shape"
            )
        return result._replace(plan=plan)


def _ask_about_taps(options: argparse.Namespace, readings: NDArray[Any]) -> None:
    """Raise InputError if bucket readings may as well be taps of spots."""
    patterns_named = any(getattr(options, name) is not None for name in PATTERNS)
    small = 0 < options.shape[0] * options.shape[1] <= MIN_TAPS
    by_spot = readings.ndim < 2 or readings.shape[-1] % 4 == 0
    if small and not patterns_named and by_spot and readings.size % MIN_TAPS == 0:
        raise InputError(
            f"{options.file} holds numbers of shape {readings.shape}: taps of four spots, or "
            f"readings of {options.shape[0]} x {options.shape[1]} patterns? For taps write --taps "
            f"{options.file} --frequency HZ in place of FILE and --shape, for patterns --order too"
        )


def _source(options: argparse.Namespace, name: str) -> NDArray[Any]:
    """Numbers of another file (FILE or FILE:VARIABLE), or of a variable or column of the same."""
    path, _, variable = name.rpartition(":")
    if Path(name).suffix.lower() in READERS:
        return load_array(name)
    if Path(path).suffix.lower() in READERS:
        return load_array(path, variable)
    if options.file is None:
        raise InputError(f"{name!r} is not a file ({', '.join(READERS)}), and FILE is missing")
    return load_array(options.file, name)


def _of_rows(
    options: argparse.Namespace, readings: NDArray[Any], shape: tuple[int, int]
) -> Recording:
    rows = _source(options, options.rows) - options.first_row
    if rows.max() == shape[0] * shape[1] and rows.min() > 0:
        raise InputError(f"--rows go from {rows.min():g} to {rows.max():g}: add --first-row 1")
    order = "natural" if options.order in (None, "auto") else options.order
    polarity = options.polarity or "signed"
    signs = polarity if options.signs is None else _source(options, options.signs)
    plan = plan_from_rows(rows, shape, order=order, polarity=signs)
    return Recording(*_with_dark(options, readings, plan))


def _of_factors(options: argparse.Namespace, readings: NDArray[Any]) -> Recording:
    names = options.factors.split(",")
    if len(names) != 2:
        raise InputError(f"--factors is {options.factors!r}, must name two, as in down,along")
    return Recording(readings, *plan_from_factors(*(_source(options, name) for name in names)))


def _of_phase_steps(
    options: argparse.Namespace, readings: NDArray[Any], shape: tuple[int, int]
) -> Recording:
    if options.phase_steps is None:
        raise InputError("--phase-steps is missing: 3 or 4 for real readings of Fourier patterns")
    frequencies = _source(options, options.frequencies)
    plan = plan_from_phase_steps(frequencies, shape, options.phase_steps)
    steps, count = options.phase_steps, plan.exposures // options.phase_steps
    if readings.shape == (steps, count) != (count, steps):
        readings = readings.T
    return Recording(readings, plan)


def _of_coefficients(
    options: argparse.Namespace, readings: NDArray[Any], shape: tuple[int, int]
) -> Recording:
    if options.frequencies is not None:
        frequencies = _source(options, options.frequencies)
        plan = plan_from_coefficients(frequencies, shape)
        return Recording(parts(readings_of(readings, plan.exposures // 2)), plan)
    if readings.shape != shape:
        raise InputError(
            f"the readings are complex and of shape {readings.shape}: Fourier coefficients are "
            f"read as a whole spectrum {shape}, or of named --frequencies"
        )
    values, numbers = half_plane(readings)
    return Recording(parts(values), plan_from_coefficients(numbers, shape))


def _with_dark(
    options: argparse.Namespace, readings: NDArray[Any], plan: PatternPlan
) -> tuple[NDArray[Any], PatternPlan]:
    """Readings and plan, with a stated dark exposure appended if none was recorded."""
    if options.dark is None:
        return readings, plan
    dc_row = plan.patterns.dc_row
    if dc_row is None:
        raise InputError("--dark needs Hadamard patterns, of which one is all on")
    dark = (plan.index == dc_row) & (plan.polarity == -1)
    if not dark.any():
        index, sign = np.append(plan.index, dc_row), np.append(plan.polarity, -1)
        plan = PatternPlan(plan.shape, index, sign, plan.order, plan.patterns)
    counts = readings_of(readings, plan.exposures - 1)
    return np.column_stack([counts, np.full(len(counts), options.dark)]), plan


def _recognised(
    options: argparse.Namespace, readings: NDArray[Any], shape: tuple[int, int]
) -> Recording:
    """Readings and the known layout that explains them best."""
    counts = _frames(readings, shape)
    if options.dark is not None:
        counts = np.column_stack([counts, np.full(len(counts), options.dark)])
    trusted = counts.astype(np.float64)
    trusted[:, [i for i in options.untrusted if 0 <= i < trusted.shape[1]]] = np.median(counts)
    candidates = recognise(trusted, shape, options.polarity)
    layout, probability = candidates[0][:2]
    for rank, candidate in enumerate(candidates[:MAX_CANDIDATES]):
        if rank == 0 or candidate.probability >= MIN_PROBABILITY:
            print(
                printable(_candidate_line(candidate)),
                file=sys.stderr if options.json else sys.stdout,
            )
    if probability < MIN_SURE:
        print("warning: the layout is uncertain; state order and polarity", file=sys.stderr)
    if layout.polarity == WITHOUT_DARK:
        dark = dark_estimate(layout.plan, trusted[0])
        hint = f"; these readings suggest about {dark:.4g}" if np.isfinite(dark) else ""
        raise InputError(
            f"the readings look like {layout}, which leaves the background unknown: state the dark "
            f"reading with --dark{hint}"
        )
    return Recording(counts, layout.plan)


def _candidate_line(candidate: Candidate) -> str:
    percent = f"{100 * candidate.probability:.1f}"
    return f"{candidate.layout}: {'over 99.9' if percent == '100.0' else percent} % sure"


def _frames(readings: NDArray[Any], shape: tuple[int, int]) -> NDArray[Any]:
    """Readings (frames, M) of an array without a known M: the longer axis."""
    if readings.ndim != 2 or 1 in readings.shape or readings.shape == shape:
        return readings.reshape(1, -1)
    return readings if readings.shape[1] >= readings.shape[0] else frames_of_columns(readings)
