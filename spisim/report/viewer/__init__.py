"""Captures, flights, data sets and streams in Rerun (rerun.io)."""

from spisim.report.viewer.recording import Recording, check_viewer, library
from spisim.report.viewer.sights import Sight, sights_of_captures, sights_of_samples
from spisim.report.viewer.stream import StreamViewer

__all__ = [
    "Recording",
    "Sight",
    "StreamViewer",
    "check_viewer",
    "library",
    "sights_of_captures",
    "sights_of_samples",
]
