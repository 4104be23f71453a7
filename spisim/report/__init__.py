"""One HTML page about one capture: what was there, what was measured, how far off it is."""

from collections.abc import Mapping
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture, Result
from reconstruction.files import write_atomically

from . import sections
from .markup import page
from .overview import write_overview
from .plots import SpotHistograms

__all__ = ["write_overview", "write_report"]


def write_report(
    path: str | Path,
    capture: Capture,
    result: Result,
    *,
    metrics: sections.Metrics | None = None,
    transport: SpotHistograms | None = None,
    view: NDArray[np.floating] | None = None,
    timings: Mapping[str, float] | None = None,
    title: str = "Capture",
) -> None:
    """Write a self-contained page. What is not known (truth, spots, view) is left out.

    Parameters
    ----------
    path: the HTML file, written whole or not at all.
    metrics: what `reconstruction.evaluate` returns.
    transport: light of the spots over path length.
    view: (h, w) transport image of the scene with more pixels (`spisim.transport.fine_view`).
    timings: seconds per step before the reconstruction.
    title: what the page calls the capture.

    Raises OSError where the file cannot be written.
    """
    provenance = capture.provenance
    steps = dict(timings or {}) | dict(result.timings_s)
    body = "".join(
        [
            f"<header><h1>{escape(title)}</h1>"
            f"<p>{_kind(capture)}, {escape(provenance.created[:10])}</p></header>",
            sections.headline(capture, result, metrics),
            sections.warnings(capture, result),
            sections.recording(capture, view),
            sections.weather(capture),
            sections.image(capture, result, metrics),
            sections.depth(capture, result),
            sections.spots(capture, result, transport),
            sections.quality(metrics),
            sections.timings(steps),
            sections.parameters(capture),
            f"<footer>{escape(provenance.software)}</footer>",
        ]
    )
    write_atomically(path, page(title, body).encode())


def _kind(capture: Capture) -> str:
    how = "Simulated" if capture.provenance.source == "simulation" else "Recorded"
    frames = "1 frame" if capture.frames == 1 else f"{capture.frames} frames"
    return f"{how} with a single-pixel detector, {frames}"
