"""Check, with captures in fog, whether a spot's path is calibrated differently from the others'."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, naming
from ..base.text import json_line, printable
from ..capture import Spots, open_capture
from ..capture.schema import present_fields
from ..ranging.fog.offsets import (
    OffsetEvidence,
    PathOffsets,
    min_significance,
    path_check,
    path_offsets,
)

EXAMPLE = "python -m reconstruction check flight/*.h5"
USEFUL_M = 0.5
"""Greater sigmas mean that there was too little fog."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command."""
    parser.add_argument("captures", metavar="CAPTURE", type=Path, nargs="+", help="capture files")


def run(options: argparse.Namespace) -> None:
    """Check all frames of the captures together."""
    offsets = path_offsets(*_evidence(options.captures))
    if options.json:
        print(json_line(_report(offsets)))
    else:
        for line in _lines(offsets):
            print(printable(line))


def _evidence(captures: Sequence[Path]) -> tuple[list[OffsetEvidence | None], int]:
    """Evidence of every frame, and how many spots there are.

    Raises InputError unless all captures are of one rig.
    """
    first: Spots | None = None
    evidence: list[OffsetEvidence | None] = []
    for path in captures:
        with naming(path), open_capture(path) as file:
            spots = file.setup.spots
            if spots is None:
                raise InputError("the capture has no time of flight, so no path to check")
            if first is None:
                first, find = spots, path_check(spots)
            elif not _alike(first, spots):
                raise InputError(f"its spots are measured differently from those of {captures[0]}")
            for number in range(file.frames):
                frame = file.frame(number).spots
                assert frame is not None
                evidence.append(find(frame))
    assert first is not None
    return evidence, len(first.directions)


def _alike(one: Spots, other: Spots) -> bool:
    """Whether optics and measurement agree, readings apart."""
    names = present_fields(one)
    return names == present_fields(other) and all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
        for name, _ in names
    )


def _report(offsets: PathOffsets) -> dict[str, Any]:
    finite = np.isfinite(offsets.sigma_m)
    spots = [
        {
            "path_offset_m": float(offsets.offset_m[spot]) if finite[spot] else None,
            "sigma_m": float(offsets.sigma_m[spot]) if finite[spot] else None,
            "told": bool(offsets.significant[spot]),
        }
        for spot in range(len(finite))
    ]
    return {"frames": offsets.frames, "spots": spots}


def _lines(offsets: PathOffsets) -> Iterator[str]:
    if offsets.sigma_m.min() > USEFUL_M:
        yield f"too little fog to check the spots' paths; frames with ranges: {offsets.frames}"
        return
    yield f"paths relative to those of the other spots, from fog in {offsets.frames} frames:"
    for spot, (offset_m, sigma_m) in enumerate(zip(offsets.offset_m, offsets.sigma_m, strict=True)):
        line = f"spot {spot}  {100 * offset_m:+6.1f} cm, standard deviation {100 * sigma_m:.1f} cm"
        if offsets.significant[spot]:
            way = "far" if offset_m > 0 else "near"
            line += f": wrongly calibrated, its ranges are {50 * abs(offset_m):.1f} cm too {way}"
        yield line
    if not offsets.significant.any():
        min_m = min_significance(offsets.sigma_m.size) * offsets.sigma_m.max()
        yield f"no spot differs from the others; {100 * min_m:.1f} cm would be significant"
