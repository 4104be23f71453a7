"""Captures, flights, data sets and streams in Rerun (rerun.io)."""

from spisim_app.report.viewer.recording import Recording, check_viewer, library
from spisim_app.report.viewer.stream import StreamViewer
from spisim_app.report.viewer.views import View, views_of_captures, views_of_samples

__all__ = [
    "Recording",
    "StreamViewer",
    "View",
    "check_viewer",
    "library",
    "views_of_captures",
    "views_of_samples",
]
