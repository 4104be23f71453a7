"""The HTML page of one capture: the scene, the measurement, and its errors."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from reconstruction import Capture, Result
from reconstruction.base.arrays import Floats, usual_float_errors
from reconstruction.capture import FrameTruth, Spots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.depth import MAX_RANGE_M, Corridor, pixel_rays
from reconstruction.diagnostics import result_warnings
from reconstruction.evaluation import method_title
from reconstruction.evaluation.comparison import compared_methods, compared_spots

from .buildup import build_up
from .capture_plots import SpotHistograms, arrival_figure, corridor_figure, light_figure
from .facts import Metrics, cards_of, facts_of, media_of, quality_of
from .page import duration, write_page
from .pictures import (
    depth_scale,
    error_scale,
    intensity_scale,
    probability_scale,
    sigma_scale,
    spot_marks,
    view_scale,
)
from .space import Space
from .style import plot_in_page, plot_style

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
@usual_float_errors
def write_report(
    path: str | Path,
    capture: Capture,
    result: Result,
    *,
    metrics: Metrics | None = None,
    transport: SpotHistograms | None = None,
    view: NDArray[np.floating] | None = None,
    timings: Mapping[str, float] | None = None,
    beside: Mapping[str, Metrics] | None = None,
    title: str = "Capture",
) -> None:
    """Write a self-contained page. Missing data (truth, spots, view) are left out.

    Parameters
    ----------
    path
        The HTML file, written whole or not at all.
    capture, result
        A capture and its reconstruction.
    metrics
        Result of `reconstruction.evaluate`.
    transport
        Light of the spots over path length.
    view
        Transport image (h, w) of the scene with more pixels (`spisim.transport.fine_view`).
    timings
        Seconds per step before the reconstruction.
    beside
        Metrics of other instruments in the same scene by name, for comparison of ranges.
    title
        Title of the capture.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    truths = capture.truth
    valid = truths is not None and truths.knows(result.frame)
    truth = truths.at(result.frame) if truths is not None and valid else None
    depths, sigmas, no_returns = (
        {method_title("depths", name): values for name, values in maps.items()}
        for maps in (result.depths, result.log_depth_sigmas, result.no_returns)
    )
    true_m = None if truth is None else _within_max_range(truth.depth_m)
    errors = {} if true_m is None else {name: depth - true_m for name, depth in depths.items()}
    images = result.images.values() if truth is None else [truth.image]
    image_scale = intensity_scale(*images, unit=f"{result.unit}s")
    aimed = result.aimed(capture.setup)
    way = None
    if truth is not None and aimed.spots is not None:
        way = _path_lengths(aimed.spots, truth.spot_range_m)
    write_page(
        path,
        "capture report",
        "capture",
        title=title,
        capture=capture,
        result=result,
        truth=truth,
        metrics=metrics,
        cards=cards_of(capture, result, metrics),
        warnings=result_warnings(result, capture),
        view=view,
        view_scale=None if view is None else view_scale(view),
        facts=facts_of(capture),
        medium=MEDIUM,
        media=media_of(capture),
        marks=spot_marks(aimed),
        images=[
            (method_title("images", name), image, quality_of(metrics, name))
            for name, image in result.images.items()
            if capture.plan.shows_image
        ],
        image_scale=image_scale,
        depths=depths,
        no_returns=no_returns,
        sigmas=sigmas,
        true_depth=true_m,
        true_no_return=None if true_m is None else np.isnan(true_m),
        max_range_m=MAX_RANGE_M,
        depth_scale=depth_scale(*(depths.values() if true_m is None else [true_m])),
        sigma_scale=sigma_scale(*sigmas.values()),
        no_return_scale=probability_scale(),
        ahead=_ahead(capture, result, truth),
        errors=errors,
        error_scale=error_scale(*errors.values()),
        rangings={method_title("spots", name): ranges for name, ranges in result.rangings.items()},
        arrivals=_arrivals(capture.spots, result.frame, way),
        light=None
        if transport is None
        else plot_in_page("light", lambda width_in: light_figure(transport, way, width_in)),
        growth=build_up(capture, result, None if truth is None else truth.image, image_scale),
        space=Space.of(capture, result),
        compared=[] if metrics is None else compared_methods(metrics),
        beside=[
            table for name, other in (beside or {}).items() for table in compared_spots(other, name)
        ],
        seconds={
            step.replace("_", " "): duration(float(f"{taken_s:.3g}"))
            for step, taken_s in (dict(timings or {}) | dict(result.timings_s)).items()
        },
    )


def _within_max_range(depth_m: NDArray[np.floating]) -> NDArray[np.floating]:
    """Replace depths beyond REACH_M by nan."""
    return np.where(depth_m <= MAX_RANGE_M, depth_m, np.nan)


def _ahead(capture: Capture, result: Result, truth: FrameTruth | None) -> Markup | None:
    """Return the probability that the corridor is free."""
    free = {method_title("depths", name): v for name, v in result.free_probabilities.items()}
    true_m = None
    if truth is not None and capture.setup.optics is not None:
        rays = pixel_rays(capture.setup.optics, truth.depth_m.shape)
        true_m = Corridor(rays).nearest_m(truth.depth_m.astype(np.float64))
    return plot_in_page(
        "ahead", lambda width_in: corridor_figure(free, result.min_free, true_m, width_in)
    )


def _path_lengths(spots: Spots, range_m: Floats) -> Floats:
    """Return path lengths from the lasers to the spots and on to their detectors, (spots,)."""
    points = range_m[:, None] * spots.directions
    back: Floats = np.linalg.norm(points - spots.detector_positions_m, axis=1)
    return range_m + back


def _arrivals(spots: Spots | None, frame: int, way: Floats | None) -> Markup | None:
    if not isinstance(spots, HistogramSpots):
        return None
    return plot_in_page("arrivals", lambda width_in: arrival_figure(spots, frame, way, width_in))
