"""The page of a flight: an animation, errors over time, and every capture."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from reconstruction.base.arrays import Floats
from reconstruction.evaluation import method_title
from spisim import __version__

from .contact_sheet import evenly
from .facts import in_all
from .flight import KIND, EvaluatedFrame, Scales, map_limits
from .page import duration, length, number, write_page
from .style import CURVE_COLOURS, WIDE_IN, plot_in_page, plot_style, spot_looks
from .units import engineering, prefix_axis

#: Captures on the page, evenly chosen from longer flights.
MAX = 100
#: Of curves of depth methods, none of them a spot's.
METHOD_COLOURS = ("#20262c", *CURVE_COLOURS[3:])
#: Time between images of the animation.
PAUSE_MS = 100, 1000


@plot_style()
def write_flight(
    path: Path,
    title: str,
    flight: Sequence[EvaluatedFrame],
    rate_hz: float,
    comparison: Mapping[str, Any] | None = None,
) -> None:
    """Write a self-contained page of a flight.

    `comparison` is that of a recording by `reconstruction.evaluation.evaluate_flight`. Raises
    OSError if it cannot be written.
    """
    displayed = [flight[k] for k in evenly(len(flight), MAX)]
    things = "captures" if comparison is None else "frames with a truth"
    scales = Scales.of(flight)
    notes = [] if comparison is None else comparison["notes"]
    common = in_all(frame.warnings for frame in flight)
    write_page(
        path,
        KIND,
        "flight",
        title=title,
        captures=len(flight),
        cards=_cards(flight, rate_hz, things) + ratio_cards(comparison or {}),
        warnings=[*notes, *(each for each in common if each not in "\n".join(notes))],
        recorded=comparison is not None,
        things=things,
        pause_ms=int(np.clip(1000 / rate_hz, *PAUSE_MS)),
        plan=_plan(displayed, map_limits(flight)),
        depth_scale=scales.depth,
        errors=plot_in_page("errors", lambda width_in: _error_figure(flight, width_in)),
        displayed=[_card(frame, scales, common) for frame in displayed],
        software=f"spisim {__version__}",
    )


def ratio_cards(comparison: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return the depth error of the first method over that of others, with its interval."""
    cards = []
    for name, ratio in comparison.get("ratio", {}).items():
        value, low, high = (number(ratio[key], 2) for key in ("abs_rel", "low", "high"))
        label = f"times the relative depth error of {method_title('depths', name)}"
        cards.append((value, label, f"95 % interval {low} to {high}"))
    return cards


def _cards(
    flight: Sequence[EvaluatedFrame], rate_hz: float, things: str
) -> list[tuple[str, str, str]]:
    path = np.array([frame.pose[:3, 3] for frame in flight])
    way_m = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    errors = _spot_errors(flight)
    finite = np.abs(errors[np.isfinite(errors)])
    depths = np.array([_depth_error(frame) for frame in flight])
    times = [frame.time_s for frame in flight]
    spots = f"{finite.size} of {errors.size} spots measured"
    typical = length(float(np.median(finite))) if finite.size else "–"
    mean_m = float(np.nanmean(depths)) if np.isfinite(depths).any() else None
    return [
        (str(len(flight)), things, f"{rate_hz:.3g} a second"),
        (duration(times[-1] - times[0]) if len(times) > 1 else "–", "from first to last", ""),
        (length(way_m), "flown", ""),
        (typical, "median range error", spots),
        (length(mean_m), "mean depth error", f"of all {things}"),
    ]


def _card(frame: EvaluatedFrame, scales: Scales, common: Sequence[str]) -> dict[str, Any]:
    """Return images and text of one capture."""
    time = f"{frame.time_s:.2f} s"
    error_m = _depth_error(frame)
    image: dict[str, Any] = next(iter(frame.metrics["images"].values()), {})
    return {
        "time": time,
        "file": frame.name,
        "words": f"{time} · mean depth error {length(error_m)}",
        "panels": scales.panels(frame),
        "error_m": error_m,
        "correlation": image.get("correlation"),
        "warnings": [warning for warning in frame.warnings if warning not in common],
    }


def _plan(displayed: Sequence[EvaluatedFrame], limits: tuple[float, ...]) -> dict[str, Any]:
    """Return path and measured spots from above in a square of 100 by 100, and a scale bar."""
    left, right, bottom, _ = limits
    scale = 100 / (right - left)

    def placed(point: Floats) -> dict[str, float]:
        return {
            "x": round(float(point[0] - left) * scale, 2),
            "y": round(100 - float(point[1] - bottom) * scale, 2),
        }

    positions = [
        placed(frame.pose[:2, 3])
        | {
            "spots": [
                placed(spot[:2]) | {"number": number}
                for number, spot in enumerate(frame.measured_m)
                if np.isfinite(spot).all()
            ]
        }
        for frame in displayed
    ]
    bar_m = float(10 ** np.floor(np.log10(0.4 * (right - left))))
    return {
        "path": " ".join(f"{position['x']},{position['y']}" for position in positions),
        "positions": positions,
        "bar": round(bar_m * scale, 2),
        "bar_words": engineering(bar_m, "m", 1),
    }


def _error_figure(flight: Sequence[EvaluatedFrame], width_in: float = WIDE_IN) -> Figure:
    times = [frame.time_s for frame in flight]
    figure = Figure(figsize=(width_in, 5.6), layout="constrained")
    spots, depth, corridor = figure.subplots(3, sharex=True)
    rows = _spot_errors(flight).T
    for row, (colour, label) in zip(rows, spot_looks(len(rows)), strict=True):
        spots.plot(times, row, "o-", ms=4, lw=1.3, color=colour, label=label)
    spots.axhline(0, color="0.5", lw=0.8, zorder=0)
    prefix_axis(spots.yaxis, "range error, m")
    methods = flight[0].methods
    for name, colour in zip(methods, METHOD_COLOURS, strict=False):
        label = method_title("depths", name) if len(methods) > 1 else ""
        curve: dict[str, Any] = {"ms": 4, "lw": 1.3, "color": colour}
        errors = [_figure_of(frame, name, "abs_rel") for frame in flight]
        depth.plot(times, errors, "o-", label=label, **curve)
        obstacles_m = [frame.result.obstacles_m.get(name, np.nan) for frame in flight]
        corridor.plot(times, obstacles_m, "o-", **curve)
    true_m = [frame.truth.corridor_m for frame in flight]
    corridor.plot(times, true_m, "--", lw=1.3, color="#4c4c4c", label="first surface")
    for axes in (depth, corridor):
        axes.set_ylim(bottom=0)
    depth.set_ylabel("relative depth error")
    prefix_axis(corridor.yaxis, "obstacle ahead, m")
    prefix_axis(corridor.xaxis, "time, s")
    figure.legend(loc="outside upper right", ncols=4 if width_in == WIDE_IN else 2)
    figure.align_ylabels()
    return figure


def _spot_errors(flight: Sequence[EvaluatedFrame]) -> Floats:
    """Return range errors (captures, spots) in metres, nan without a range."""
    return np.array(
        [
            np.full_like(frame.truth.spot_range_m, np.nan)
            if frame.result.ranges is None
            else np.asarray(frame.result.ranges.range_m) - frame.truth.spot_range_m
            for frame in flight
        ]
    )


def _depth_error(frame: EvaluatedFrame) -> float:
    """Return the mean error of the depth map in metres, nan without one."""
    return _figure_of(frame, next(iter(frame.metrics["depths"]), ""), "mae_m")


def _figure_of(frame: EvaluatedFrame, method: str, key: str) -> float:
    """Return a figure of a depth method, nan without it."""
    value = frame.metrics["depths"].get(method, {}).get(key)
    return np.nan if value is None else float(value)
