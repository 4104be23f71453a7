"""The capture file that rig and simulator share: a recording, its frames and its truth."""

from .buckets import Buckets, Unit
from .charge import Charge, PatternTaps, check_taps
from .file import CaptureFile, datasets, open_capture, read_capture, read_setup, write_capture
from .model import (
    PARTS,
    SURROGATE,
    Capture,
    Frames,
    Optics,
    Provenance,
    Recording,
    Setup,
    check_frames,
    check_parts,
)
from .poses import Poses
from .readings import READINGS
from .readings.cw import CwSpots
from .readings.dtof import HistogramSpots
from .readings.pulsed import PulsedSpots
from .schema import stored_fields
from .selection import first_patterns
from .spots import Spots
from .truth import FrameTruth, Truth

__all__ = [
    "PARTS",
    "READINGS",
    "SURROGATE",
    "Buckets",
    "Capture",
    "CaptureFile",
    "Charge",
    "CwSpots",
    "FrameTruth",
    "Frames",
    "HistogramSpots",
    "Optics",
    "PatternTaps",
    "Poses",
    "Provenance",
    "PulsedSpots",
    "Recording",
    "Setup",
    "Spots",
    "Truth",
    "Unit",
    "check_frames",
    "check_parts",
    "check_taps",
    "datasets",
    "first_patterns",
    "open_capture",
    "read_capture",
    "read_setup",
    "stored_fields",
    "write_capture",
]
