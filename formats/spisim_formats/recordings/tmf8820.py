"""Histograms of a TMF8820, as cpsiff/SPAD-ICCP-Summer-School and its relatives write them to JSON.

A list of frames, each with ``hists`` (9 zones of 128 bins) and ``reference_hist``, the sensor's own
picture of its pulse, whose median delay over the frames is the time zero. The file states neither
the width of a bin nor the number of cycles, nor where zones look: bins and cycles are those
measured on a wall, and directions those of the data sheet's normal mode. Pose, temperature and the
sensor's own ranges are left out. Ranges count from the sensor along the middle of each zone.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, naming
from reconstruction.capture.importers import (
    ProgramRecording,
    SpotGeometry,
    spots_from_histograms,
)
from reconstruction.operators import NO_PATTERN
from reconstruction.ranging.histogram import find_pulses

NAMES = "hists", "reference_hist"
ROWS, BINS = 3, 128
#: Full angles across and down, of the data sheet.
FIELD_DEG = 33.0, 32.0
#: Measured on a wall; see the preset `tmf8820`.
BIN_WIDTH_S, CYCLES = 94.57e-12, 4_160_000
#: Mean delay of zones after the reference at a range of zero, in bins: their path is the shorter.
ZONES_AFTER_REFERENCE = -1.365
#: So many cycles that no arrival of the reference hides another.
MANY_CYCLES = 10**12
#: Characters read to recognise a file, and the largest that is read.
HEAD, MAX_BYTES = 4096, 2**28


def load_tmf8820(path: Path) -> ProgramRecording:
    """Load the frames of a file. Raises InputError if it is missing or invalid."""
    with naming(path):
        frames = _frames(path)
        counts = np.array([_counts(frame, "hists", (ROWS**2, BINS)) for frame in frames])
        reference = np.array([_counts(frame, "reference_hist", (BINS,)) for frame in frames])
        if not (reference.sum(axis=-1) > 0).all():
            raise InputError("reference_hist is empty, which gives the time zero of a frame")
        if (most := counts.sum(axis=-1).max()) > CYCLES:
            raise InputError(
                f"a histogram holds {most:.0f} arrivals; in {CYCLES} cycles, at most one in each"
            )
        delay = float(np.median(find_pulses(reference, MANY_CYCLES, None).delay))
        spots = spots_from_histograms(
            counts,
            BIN_WIDTH_S,
            CYCLES,
            delay_offset_s=BIN_WIDTH_S * (delay + ZONES_AFTER_REFERENCE),
            geometry=SpotGeometry(directions()),
        )
    return ProgramRecording(np.zeros((len(frames), 1)), NO_PATTERN, {}, spots)


def directions() -> Floats:
    """Unit vectors (9, 3) through the middle of each zone, by rows from the top left."""
    x, y = (
        np.tan(np.radians(full) / 2) * (2 * np.arange(ROWS) + 1 - ROWS) / ROWS for full in FIELD_DEG
    )
    rays = np.stack([*np.meshgrid(x, y), np.ones((ROWS, ROWS))], axis=-1).reshape(-1, 3)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _frames(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        raise InputError("no such file")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"has more than {MAX_BYTES // 2**20} MiB")
    try:
        frames = json.loads(path.read_text("utf-8-sig", "replace"))
    except (ValueError, RecursionError):
        raise InputError("not readable as JSON") from None
    if not (isinstance(frames, list) and frames and all(isinstance(each, dict) for each in frames)):
        raise InputError("should hold a list of frames, each an object with hists")
    return frames


def _counts(frame: dict[str, Any], name: str, shape: tuple[int, ...]) -> Floats:
    try:
        counts = np.array(frame.get(name), dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name} should hold numbers, of shape {shape}") from None
    if counts.shape != shape:
        raise InputError(f"{name} has shape {counts.shape}, expected {shape}")
    if not (np.isfinite(counts).all() and (counts >= 0).all() and (counts % 1 == 0).all()):
        raise InputError(f"{name} should hold counts: whole numbers from 0")
    return counts


class Tmf8820:
    """Files of a TMF8820; see `RecordingFormat`."""

    def recognises(self, path: Path) -> bool:
        """Whether a JSON file begins with a frame of histograms."""
        if path.suffix != ".json" or not path.is_file():
            return False
        with path.open(encoding="utf-8", errors="replace") as file:
            head = file.read(HEAD)
        return head.lstrip("\ufeff \n\r\t").startswith("[") and any(f'"{n}"' in head for n in NAMES)

    def load(self, path: Path, band_nm: tuple[float, float] | None = None) -> ProgramRecording:
        """See `load_tmf8820`; raises InputError for a band, as there is one wavelength."""
        if band_nm is not None:
            raise InputError(f"{path}: has one wavelength, 940 nm; leave out the band")
        return load_tmf8820(path)


RECORDING = Tmf8820()
