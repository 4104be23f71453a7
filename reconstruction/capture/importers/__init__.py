"""Import of recordings of existing rigs, and of plain arrays, as captures."""

from .about import ABOUT, read_about
from .arrays import (
    capture_from_readings,
    frames_of_columns,
    plan_from_factors,
    plan_from_matrix,
    plan_from_rows,
    readings_of,
)
from .files import READERS, TEXTS, load_array
from .fourier import PHASE_STEPS, half_plane, parts, plan_from_coefficients, plan_from_phase_steps
from .programs import RECORDINGS, ProgramRecording, RecordingFormat, program_of
from .taps import (
    QUARTERS_RAD,
    TAPS_ABOUT,
    SpotGeometry,
    added,
    by_spot,
    capture_from_spots,
    spots_from_histograms,
    spots_from_taps,
    spots_from_windows,
)

__all__ = [
    "ABOUT",
    "PHASE_STEPS",
    "QUARTERS_RAD",
    "READERS",
    "RECORDINGS",
    "TAPS_ABOUT",
    "TEXTS",
    "ProgramRecording",
    "RecordingFormat",
    "SpotGeometry",
    "added",
    "by_spot",
    "capture_from_readings",
    "capture_from_spots",
    "frames_of_columns",
    "half_plane",
    "load_array",
    "parts",
    "plan_from_coefficients",
    "plan_from_factors",
    "plan_from_matrix",
    "plan_from_phase_steps",
    "plan_from_rows",
    "program_of",
    "read_about",
    "readings_of",
    "spots_from_histograms",
    "spots_from_taps",
    "spots_from_windows",
]
