"""One HTML page about one capture: what was there, what was measured, how far off it is."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reconstruction import Capture, Result, capture_warnings
from reconstruction.arrays import Floats
from reconstruction.capture import Setup, Spots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.depth import REACH_M
from reconstruction.errors import InputError
from reconstruction.evaluation import method_title
from spisim.config import load_yaml

from .comparison import compared_methods
from .page import duration, length, number, write_page
from .pictures import (
    data_address,
    depth_scale,
    deviation_scale,
    error_scale,
    intensity_scale,
    probability_scale,
    spot_marks,
    view_scale,
)
from .spot_plots import SpotHistograms, arrival_figure, light_figure
from .style import file_of, plot_style

Metrics = Mapping[str, Any]
Cards = list[tuple[str, str, str]]

MEDIUM = {
    "": "where",
    "kind": "kind",
    "extinction, 1/m": "extinction_per_m",
    "albedo": "albedo",
    "g": "g",
    "p(180°), 1/sr": "backscatter_per_sr",
    "visibility, m": "visibility_m",
    "water, g/m³": "water_g_per_m3",
}


@plot_style()
def write_report(
    path: str | Path,
    capture: Capture,
    result: Result,
    *,
    metrics: Metrics | None = None,
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
    truths = capture.truth
    known = truths is not None and truths.knows(result.frame)
    truth = truths.at(result.frame) if truths is not None and known else None
    depths, deviations, nothings = (
        {method_title("depths", name): values for name, values in maps.items()}
        for maps in (result.depths, result.depth_deviations, result.nothings)
    )
    true_m = None if truth is None else _within_reach(truth.depth_m)
    errors = {} if true_m is None else {name: depth - true_m for name, depth in depths.items()}
    spots = capture.spots
    way = None if truth is None or spots is None else _path_lengths(spots, truth.spot_range_m)
    write_page(
        path,
        "capture report",
        "capture",
        title=title,
        capture=capture,
        result=result,
        truth=truth,
        metrics=metrics,
        cards=_cards(capture, result, metrics),
        warnings=[*capture_warnings(capture, result.frame), *result.warnings],
        view=view,
        view_scale=None if view is None else view_scale(view),
        facts=_facts(capture),
        medium=MEDIUM,
        media=media_of(capture),
        marks=spot_marks(capture),
        images=[
            (method_title("images", name), image, _quality(metrics, name))
            for name, image in result.images.items()
        ],
        image_scale=intensity_scale(
            *(result.images.values() if truth is None else [truth.image]), unit=f"{result.unit}s"
        ),
        depths=depths,
        nothings=nothings,
        deviations=deviations,
        true_depth=true_m,
        true_nothing=None if true_m is None else np.isnan(true_m),
        reach_m=REACH_M,
        depth_scale=depth_scale(*(depths.values() if true_m is None else [true_m])),
        deviation_scale=deviation_scale(*deviations.values()),
        nothing_scale=probability_scale(),
        errors=errors,
        error_scale=error_scale(*errors.values()),
        rangings={method_title("spots", name): ranges for name, ranges in result.rangings.items()},
        arrivals=_plot(
            arrival_figure(spots, result.frame, way) if isinstance(spots, HistogramSpots) else None
        ),
        light=_plot(None if transport is None else light_figure(transport, way)),
        compared=[] if metrics is None else compared_methods(metrics),
        seconds=dict(timings or {}) | dict(result.timings_s),
    )


def media_of(capture: Capture) -> list[Mapping[str, Any]]:
    """What hung in the air of a simulation: `media` of its settings; none of other recordings."""
    try:
        settings = load_yaml(capture.provenance.settings, "settings")
    except InputError:  # of another program
        return []
    media = settings.get("media") if isinstance(settings, dict) else None
    return [one for one in media if isinstance(one, dict)] if isinstance(media, list) else []


def _cards(capture: Capture, result: Result, metrics: Metrics | None) -> Cards:
    """The figures that tell how good the reconstruction is."""
    plan = capture.plan
    patterns = f"{plan.sampled} of {plan.pixels} patterns, {plan.exposures} exposures"
    cards = [(f"{100 * plan.sampling_ratio:.3g} %", "sampling ratio", patterns)]
    frame_s = plan.exposures * capture.buckets.pattern_period_s
    reconstructed = f"{1e3 * sum(result.timings_s.values()):.0f} ms"
    if np.isfinite(frame_s):
        cards.append((f"{1 / frame_s:.3g} Hz", "frame rate", f"reconstructed in {reconstructed}"))
    else:
        cards.append((reconstructed, "to reconstruct", "frame rate not known"))
    return cards if metrics is None else cards + _quality_cards(metrics)


def _quality_cards(metrics: Metrics) -> Cards:
    """Of each station the first method's figure, and those of the others."""
    cards = []
    for station, key, label, written in (
        ("images", "correlation", "image correlation", lambda value: number(value, 3)),
        ("depths", "mae_m", "mean depth error", length),
    ):
        told = {name: written(figures[key]) for name, figures in metrics[station].items()}
        others = [f"{method_title(station, name)} {value}" for name, value in told.items()][1:]
        cards += [(value, label, ", ".join(others)) for value in list(told.values())[:1]]
    for spots in list(metrics["spots"].values())[:1]:
        errors = [abs(spot["error_m"]) for spot in spots if spot["error_m"] is not None]
        largest = length(max(errors, default=None))
        cards.insert(1, (largest, "largest range error", f"of {len(errors)} measured spots"))
    return cards


def _quality(metrics: Metrics | None, method: str) -> str:
    if metrics is None:
        return ""
    figures = metrics["images"][method]
    gain = figures["gain_db"]
    return (
        f"correlation {number(figures['correlation'], 3)}, "
        f"gain {'–' if gain is None else f'{gain:+.1f} dB'}"
    )


def _facts(capture: Capture) -> dict[str, str]:
    """How the capture was recorded."""
    provenance, plan, buckets = capture.provenance, capture.plan, capture.buckets
    height, width = plan.shape
    noise = buckets.noise_electrons
    facts = {
        "source": provenance.source,
        "software": provenance.software,
        "seed": "–" if provenance.seed is None else str(provenance.seed),
        "frames": str(capture.frames),
        "virtual pixels": f"{width} × {height}",
        "patterns": f"{plan.sampled} of {plan.pixels}, {plan.basis}, {plan.order}",
        "exposures": str(plan.exposures),
        **_of_several_frames(capture.setup),
        "exposure time": duration(buckets.exposure_time_s),
        "duration": duration(plan.exposures * buckets.pattern_period_s),
        "electronics noise": (
            f"{noise:,.0f} electrons rms per exposure" if np.isfinite(noise) else "not known"
        ),
        "saturated readings": str(int(np.count_nonzero(~buckets.usable))),
    }
    if capture.spots is not None:
        facts["time of flight"] = capture.spots.summary
    if capture.pattern_taps is not None:
        facts["of every pattern"] = capture.pattern_taps.summary
    return facts


def _of_several_frames(setup: Setup) -> dict[str, str]:
    """What frames that show different patterns show together."""
    if not setup.later_plans:
        return {}
    shown = np.unique(np.concatenate([plan.index for plan in setup.plans])).size
    return {"of several frames": f"{shown} patterns, which {len(setup.plans)} frames deal out"}


def _within_reach(depth_m: NDArray[np.floating]) -> NDArray[np.floating]:
    """Depths, nan beyond REACH_M."""
    return np.where(depth_m <= REACH_M, depth_m, np.nan)


def _path_lengths(spots: Spots, range_m: Floats) -> Floats:
    """From the laser's exit to the spot and on to its detector (4,)."""
    points = range_m[:, None] * spots.directions
    back: Floats = np.linalg.norm(points - spots.detector_positions_m, axis=1)
    return range_m + back


def _plot(figure: Figure | None) -> str | None:
    return None if figure is None else data_address(file_of(figure, "plot", "svg"), "image/svg+xml")
