"""Readings as recorded (taps, phasors, histograms), ranges over time, images and depth maps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.ranging.methods.cw import quadrature_weights
from spisim_app.report.viewer.space import rgb_of_spots, spot_words
from spisim_app.report.viewer.views import View


def draw_readings(rerun: Any, stream: Any, view: View) -> None:
    """Log readings as bars, phasors in their plane, ranges as curves, and notes."""
    stream.log("notes", rerun.TextDocument(_notes(view), media_type="text/markdown"))
    if view.frame is not None:
        stream.log("readings/patterns", rerun.BarChart(view.frame.buckets.counts[0]))
        _draw_spots(rerun, stream, view.frame.spots)
        taps = view.frame.pattern_taps
        if taps is not None:
            tensor = rerun.Tensor(taps.taps[0], dim_names=("exposure", "tap"))
            stream.log("readings/pattern_taps", tensor)
    ranges = view.shot.ranges
    if ranges is None:
        return
    for k, (range_m, sigma_m) in enumerate(zip(ranges.range_m, ranges.sigma_m, strict=True)):
        if np.isfinite(range_m):
            stream.log(f"ranges/spot_{k}", rerun.Scalars(range_m))
            stream.log(f"sigmas/spot_{k}", rerun.Scalars(sigma_m))
        if view.truth is not None and np.isfinite(view.truth.spot_range_m[k]):
            stream.log(f"ranges/true_{k}", rerun.Scalars(view.truth.spot_range_m[k]))


def style_ranges(rerun: Any, stream: Any, spots: range) -> None:
    """Give the curves of some spots their colours, paler for the truth."""
    for k, colour in zip(spots, rgb_of_spots(spots.stop)[spots.start :], strict=True):
        pale = (colour.astype(int) + 255) // 2
        for name, shade, width in (("spot", colour, 2.0), ("true", pale, 1.0)):
            line = rerun.SeriesLines(colors=[shade.tolist()], names=f"{name} {k}", widths=[width])
            stream.log(f"ranges/{name}_{k}", line, static=True)


def _draw_spots(rerun: Any, stream: Any, spots: Any) -> None:
    """Log the taps or the histogram of each spot, and phasors of continuous waves."""
    if spots is None:
        return
    colours = rgb_of_spots(len(spots.directions))
    if isinstance(spots, HistogramSpots):
        bins = spots.start_s + (np.arange(spots.counts.shape[-1]) + 0.5) * spots.bin_width_s
        for k, colour in enumerate(colours):
            bars = rerun.BarChart(spots.counts[0, k], color=colour, abscissa=1e9 * bins)
            stream.log(f"readings/histograms/spot_{k}", bars)
        return
    for k, colour in enumerate(colours):
        stream.log(f"readings/taps/spot_{k}", rerun.BarChart(spots.readings[0, k], color=colour))
    if isinstance(spots, CwSpots):
        for hertz, phasors in phasors_of(spots).items():
            # up is positive, whereas y points down in images
            ends = np.stack([phasors.real, -phasors.imag], axis=-1).astype(np.float32)
            arrows = rerun.Arrows2D(
                vectors=ends, colors=colours, labels=[f"spot {k}" for k in range(len(ends))]
            )
            stream.log(["phasors", f"{hertz / 1e6:.6g} MHz"], arrows)


def phasors_of(spots: CwSpots) -> dict[float, np.ndarray]:
    """Return A exp(i phi) (spots,) in electrons of the first frame, by modulation frequency."""
    electrons = spots.electrons(spots.taps[0])
    result = {}
    for hertz in np.unique(spots.tap_frequencies_hz).tolist():
        of = spots.tap_frequencies_hz == hertz
        weights = quadrature_weights((spots.tap_phases_rad - spots.phase_offsets_rad)[of])
        _, cosine, sine = np.moveaxis(electrons[:, of] @ weights.T, -1, 0)
        result[hertz] = cosine + 1j * sine
    return result


def _notes(view: View) -> str:
    lines = [f"**{view.title}**, frame {view.result.frame}"]
    lines += [f"- {words}" for words in spot_words(view.result)]
    ranges = view.shot.ranges
    if ranges is not None and ranges.fog is not None:
        lines.append(f"- fog: extinction {ranges.fog.extinction_per_m:.4g} per metre")
    if ranges is not None and ranges.visibility is not None:
        lines.append(f"- visibility (2 % contrast): {ranges.visibility}")
    if view.truth is not None and view.shot.depth_m is not None:
        error = np.abs(view.shot.depth_m - view.truth.depth_m)
        if np.isfinite(error).any():
            lines.append(f"- depth: mean error {np.nanmean(error):.3f} m")
    lines += [f"- warning: {text}" for text in view.shot.warnings]
    return "\n".join(lines)


def draw_pictures(rerun: Any, stream: Any, view: View) -> None:
    """Log images in grey, on one scale with the truth, and depth maps in metres."""
    truth, depth_m = view.truth, view.shot.depth_m
    brightest = float(np.max(view.shot.image if truth is None else truth.image))
    _draw_image(rerun, stream, "images/image", view.shot.image, brightest)
    if truth is not None:
        _draw_image(rerun, stream, "images/truth", truth.image, brightest)
    finite = [map_m for map_m in (depth_m, None if truth is None else truth.depth_m)
             if map_m is not None and np.isfinite(map_m).any()]  # fmt: skip
    farthest_m = max((float(np.nanmax(map_m)) for map_m in finite), default=1.0)
    maps = {"depth/depth": depth_m, "depth/truth": None if truth is None else truth.depth_m}
    for name, map_m in maps.items():
        if map_m is not None:
            depths = np.nan_to_num(map_m).astype(np.float32)
            stream.log(name, rerun.DepthImage(depths, meter=1.0, depth_range=(0.0, farthest_m)))


def _draw_image(
    rerun: Any, stream: Any, name: str, image: NDArray[np.floating], brightest: float
) -> None:
    grey = np.clip(255 * image / max(brightest, np.finfo(np.float64).tiny), 0, 255)
    stream.log(name, rerun.Image(grey.astype(np.uint8), color_model="L"))
