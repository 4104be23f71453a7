"""The parts of the report; each is empty where the capture does not hold what it shows."""

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from reconstruction import Capture, Result, capture_warnings
from reconstruction.capture import PatternTaps, Spots
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.depth import DEPTH_METHODS
from reconstruction.image import image_method

from .markup import card, details, duration, length, number, section, table
from .pictures import (
    colour_bar,
    depth_scale,
    error_scale,
    figure,
    intensity_scale,
    spot_marks,
    view_scale,
)
from .plots import SpotHistograms, arrival_plot, spot_plot

Metrics = Mapping[str, Any]

METRICS = {
    "nrmse": "RMS error over RMS of the truth",
    "psnr_db": "PSNR, dB",
    "mae_m": "mean absolute error, m",
    "rmse_m": "RMS error, m",
    "median_relative": "median relative error",
    "within_25_percent": "share within 25 % of truth",
    "coverage": "share of pixels with a value",
}

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

_READINGS = {
    "cw": "Signal and background are amplitude and mean of a tap at the first frequency.",
    "pulsed": "Signal is the whole pulse, background that of one window.",
    "dtof": "Signal is the arrivals of the pulse, background those in one time bin.",
}


def headline(capture: Capture, result: Result, metrics: Metrics | None) -> str:
    """The figures that tell how good the reconstruction is."""
    plan = capture.plan
    cards = [
        card(
            f"{100 * plan.sampling_ratio:.3g} %",
            "sampling ratio",
            f"{plan.sampled} of {plan.pixels} patterns, {plan.exposures} exposures",
        ),
    ]
    frame_s = plan.exposures * capture.buckets.pattern_period_s
    reconstructed = f"{1e3 * sum(result.timings_s.values()):.0f} ms"
    if np.isfinite(frame_s):
        cards.append(
            card(f"{1 / frame_s:.3g} Hz", "frame rate", f"reconstructed in {reconstructed}")
        )
    else:
        cards.append(card(reconstructed, "to reconstruct", "frame rate not known"))
    if metrics and "image" in metrics:
        image = metrics["image"]
        cards.append(
            card(
                number(image["correlation"], 3),
                "image correlation",
                f"zero-filled {number(image['zero_filled']['correlation'], 3)}",
            )
        )
    if metrics and metrics.get("spots"):
        errors = [abs(s["error_m"]) for s in metrics["spots"] if s["error_m"] is not None]
        cards.append(
            card(
                length(max(errors, default=None)),
                "largest range error",
                f"of {len(errors)} measured spots",
            )
        )
    cards += _depth_cards((metrics or {}).get("depth") or {})
    return f'<div class="cards">{"".join(cards)}</div>'


def _depth_cards(metrics: Metrics) -> list[str]:
    cards = []
    if "anchored" in metrics:
        nearest = length(metrics["nearest"]["mae_m"])
        error = length(metrics["anchored"]["mae_m"])
        cards.append(card(error, "mean depth error", f"nearest anchor {nearest}"))
    if "dense" in metrics:
        covered = 100 * (metrics["dense"]["coverage"] or 0)
        error = length(metrics["dense"]["mae_m"])
        cards.append(card(error, "mean dense depth error", f"in {covered:.3g} % of the pixels"))
    return cards


def warnings(capture: Capture, result: Result) -> str:
    """What its reader should know before believing the rest."""
    items = "".join(f"<li>{escape(line)}</li>" for line in capture_warnings(capture, result.frame))
    return f'<ul class="warnings">{items}</ul>' if items else ""


def recording(capture: Capture, view: NDArray[np.floating] | None) -> str:
    """What a camera at the projector sees, and how it was recorded."""
    facts = table(["", ""], _facts(capture))
    if view is None:
        return section("Recording", "", facts)
    scale = view_scale(view)
    told = "As the instrument would see it with more pixels and without noise."
    bar = colour_bar(scale, "share of the light that comes back")
    picture = figure(view, scale, "Scene", told)
    return section(
        "Recording",
        "",
        f'<div class="row recording"><div>{picture}{bar}</div>{facts}</div>',
    )


def weather(capture: Capture) -> str:
    """What hung in the air of a simulation, as its settings tell."""
    rows = [[_plain(medium.get(key)) for key in MEDIUM.values()] for medium in media_of(capture)]
    explanation = "Media at the instrument's wavelength; p(180°) is what goes straight back."
    return section("Weather", explanation, table(MEDIUM, rows)) if rows else ""


def image(capture: Capture, result: Result, metrics: Metrics | None) -> str:
    """True, reconstructed and zero-filled image."""
    true = None if capture.truth is None else capture.truth.at(result.frame).image
    scale = intensity_scale(
        *(result.images.values() if true is None else [true]),
        unit=f"{result.unit}s",
    )
    quality = (metrics or {}).get("images", {})
    pictures = [
        figure(
            image,
            scale,
            image_method(name).title.capitalize(),
            _quality(quality.get(name, {})),
            spot_marks(capture),
        )
        for name, image in result.images.items()
    ]
    if true is not None:
        pictures.insert(0, figure(true, scale, "True", "What each pixel alone would give."))
    return section(
        "Image",
        "Light of each virtual pixel on the single-pixel detector. The zero-filled inverse takes "
        "every pattern that was not shown as zero. Both methods start from the same coefficients, "
        "less the error that these share.",
        f'<div class="row">{"".join(pictures)}</div>{colour_bar(scale, "per exposure")}',
    )


def depth(capture: Capture, result: Result) -> str:
    """True, anchored, nearest-anchor and dense depth, and their errors."""
    known = {
        DEPTH_METHODS[name].title.capitalize(): values for name, values in result.depths.items()
    }
    if not known:
        return ""
    true = None if capture.truth is None else capture.truth.at(result.frame).depth_m
    scale = depth_scale(*([true] if true is not None else known.values()))
    marks = spot_marks(capture)
    pictures = [figure(values, scale, title, over=marks) for title, values in known.items()]
    if true is None:
        body = f'<div class="row">{"".join(pictures)}</div>{colour_bar(scale, "depth")}'
    else:
        pictures.insert(0, figure(true, scale, "True", "Component along the optical axis."))
        errors = {title: values - true for title, values in known.items()}
        error = error_scale(*errors.values())
        differences = [
            figure(values, error, f"Error: {title.lower()}", over=marks)
            for title, values in errors.items()
        ]
        body = (
            f'<div class="row">{"".join(pictures)}</div>{colour_bar(scale, "depth")}'
            f'<div class="row"><p class="aside">Reconstructed minus true depth: blue is too near, '
            f"red is too far.</p>{''.join(differences)}</div>{colour_bar(error, 'error')}"
        )
    lead = []
    if result.depth_m is not None:
        lead.append(
            "Four measured ranges spread over the image, beside the plain choice: each pixel "
            "takes the depth of the spot nearest to it."
        )
    if "dense" in result.depths:
        lead.append("From time of flight of every pattern, each pixel has a depth of its own.")
    return section("Depth", " ".join([*lead, "Hatched where there is none."]), body)


def spots(capture: Capture, result: Result, transport: SpotHistograms | None) -> str:
    """Ranges of the laser spots, and the light over path length behind them."""
    if result.ranges is None or capture.spots is None:
        return ""
    ranges = result.ranges
    true = None if capture.truth is None else capture.truth.at(result.frame).spot_range_m
    rows = []
    for k, measured in enumerate(ranges.range_m):
        expected = np.nan if true is None else true[k]
        rows.append(
            [
                f'<span class="dot" style="--colour:var(--spot-{k})"></span>spot {k}',
                number(expected, 3),
                number(measured, 3),
                number(100 * (measured - expected), 1),
                number(100 * ranges.sigma_m[k], 1),
                number(ranges.signal_electrons[k], 0),
                number(ranges.background_electrons[k], 0),
                escape(ranges.status[k]),
            ]
        )
    heads = ["", "true, m", "measured, m", "error, cm", "sigma, cm", "signal, e⁻", "background, e⁻"]
    heads.append("")
    lead = (
        "Range along each laser's ray. Sigma is its noise; the bias from light that came another "
        f"way is not in it. {_READINGS[capture.spots.method]}"
    )
    way = None if true is None else _path_lengths(capture, true)
    plots = ""
    if isinstance(capture.spots, HistogramSpots):
        plots += _aside("The arrivals as recorded.")
        plots += arrival_plot(capture.spots, result.frame, way)
    if transport is not None:
        plots += _aside(
            "The light that comes back over its whole way: what stands before the dashed line of "
            "the true way is fog."
        )
        plots += spot_plot(transport, way)
    return section("Laser spots", lead, table(heads, rows) + plots)


def quality(metrics: Metrics | None) -> str:
    """All metrics against truth."""
    if not metrics:
        return ""
    tables = []
    if "image" in metrics:
        both = {"reconstructed": metrics["image"], "zero-filled": metrics["image"]["zero_filled"]}
        tables.append(_comparison("image", both))
    if metrics.get("depth"):
        tables.append(_comparison("depth", metrics["depth"]))
    return section("Against truth", _truth_noise(metrics), "".join(tables))


def timings(seconds: Mapping[str, float]) -> str:
    """How long each step took."""
    rows = [[escape(step.replace("_", " ")), number(s, 3)] for step, s in seconds.items()]
    return section("Time", "", table(["step", "s"], rows)) if rows else ""


def parameters(capture: Capture) -> str:
    """Everything that is needed to make the capture again."""
    provenance = capture.provenance
    texts = {
        "Instrument": provenance.instrument,
        "Scene": provenance.scene,
        "Settings of the simulator": provenance.settings,
    }
    body = "".join(details(title, text) for title, text in texts.items() if text)
    return section("Parameters", "", body) if body else ""


def media_of(capture: Capture) -> list[Mapping[str, Any]]:
    """What hung in the air of a simulation: `media` of its settings; none of other recordings."""
    try:
        settings = yaml.safe_load(capture.provenance.settings)
    except yaml.YAMLError:  # of another program
        return []
    media = settings.get("media") if isinstance(settings, dict) else None
    return [one for one in media if isinstance(one, dict)] if isinstance(media, list) else []


def _plain(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))


def _aside(text: str) -> str:
    return f'<p class="aside">{escape(text)}</p>'


def _facts(capture: Capture) -> list[list[str]]:
    """How the capture was recorded, as rows of a table."""
    provenance, plan, buckets = capture.provenance, capture.plan, capture.buckets
    height, width = plan.shape
    facts = {
        "source": provenance.source,
        "software": provenance.software,
        "seed": "–" if provenance.seed is None else str(provenance.seed),
        "frames": str(capture.frames),
        "virtual pixels": f"{width} × {height}",
        "patterns": f"{plan.sampled} of {plan.pixels}, {plan.basis}, {plan.order}",
        "exposures": str(plan.exposures),
        "exposure time": duration(buckets.exposure_time_s),
        "duration": duration(plan.exposures * buckets.pattern_period_s),
        "electronics noise": _electrons(buckets.noise_electrons),
        "saturated readings": str(int(np.count_nonzero(~buckets.usable))),
    }
    if capture.spots is not None:
        facts["time of flight"] = _method(capture.spots)
    if capture.pattern_taps is not None:
        facts["of every pattern"] = _continuous_wave(capture.pattern_taps)
    return [[name, escape(value)] for name, value in facts.items()]


def _method(spots: Spots) -> str:
    """How time of flight was measured, in a few words."""
    if isinstance(spots, CwSpots):
        return _continuous_wave(spots)
    if isinstance(spots, PulsedSpots):
        return f"pulsed, three windows of {duration(spots.pulse_width_s)}"
    if isinstance(spots, HistogramSpots):
        bins = spots.counts.shape[-1]
        return f"histograms, {bins} bins of {duration(spots.bin_width_s)}"
    raise TypeError(f"unknown {type(spots).__name__}")


def _continuous_wave(readings: CwSpots | PatternTaps) -> str:
    frequencies = ", ".join(f"{f / 1e6:g}" for f in np.unique(readings.tap_frequencies_hz))
    return f"continuous wave, {readings.taps.shape[-1]} taps, {frequencies} MHz"


def _path_lengths(capture: Capture, range_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """From the laser's exit to the spot and on to its detector (4,)."""
    assert capture.spots is not None
    points = range_m[:, None] * capture.spots.directions
    back: NDArray[np.float64] = np.linalg.norm(points - capture.spots.detector_positions_m, axis=1)
    return range_m + back


def _truth_noise(metrics: Metrics) -> str:
    noise = metrics.get("truth", {}).get("image_noise")
    if noise is None:
        return ""
    return (
        f"The true image is a Monte Carlo estimate too: its standard error is {100 * noise:.2g} % "
        "of its RMS."
    )


def _comparison(name: str, columns: Mapping[str, Mapping[str, Any]]) -> str:
    """Metrics as rows, methods as columns."""
    first = next(iter(columns.values()))
    keys = [key for key, value in first.items() if not isinstance(value, Mapping)]
    rows = [
        [METRICS.get(key, key.replace("_", " ")), *(number(c[key], 3) for c in columns.values())]
        for key in keys
    ]
    return table([name, *columns], rows)


def _quality(metrics: Mapping[str, Any]) -> str:
    if not metrics:
        return ""
    correlation, nrmse = number(metrics["correlation"], 3), number(metrics["nrmse"], 3)
    return f"correlation {correlation}, NRMSE {nrmse}"


def _electrons(noise: float) -> str:
    return f"{noise:,.0f} electrons rms per exposure" if np.isfinite(noise) else "not known"
