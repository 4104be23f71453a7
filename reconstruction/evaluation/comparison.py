"""Results of `evaluate` and `evaluate_flight` as tables of text."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from ..ranging import RANGED, Alternative
from .methods import method_title, no_range


@dataclass(frozen=True)
class Comparison:
    """A comparison table; the first cell of each row is its heading."""

    name: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


FIGURES: Mapping[str, Mapping[str, tuple[str, float, str]]] = {
    "images": {
        "correlation": ("correlation", 1, "{:.3f}"),
        "nrmse": ("RMS error over RMS of the truth", 1, "{:.3f}"),
        "psnr_db": ("PSNR, dB", 1, "{:.3f}"),
        "gain_db": ("gain over the better of zero-filled and flat, dB", 1, "{:+.2f}"),
    },
    "depths": {
        "mae_m": ("mean error, m", 1, "{:.3f}"),
        "rmse_m": ("RMS error, m", 1, "{:.3f}"),
        "median_relative": ("median error", 100, "{:.1f} %"),
        "abs_rel": ("mean relative error", 100, "{:.1f} %"),
        "within_25_percent": ("within 25 % of truth", 100, "{:.1f} %"),
        "delta_1_25": ("within a factor of 1.25", 100, "{:.1f} %"),
        "coverage": ("pixels with a value", 100, "{:.1f} %"),
        "within_1_sigma": ("within 1 sigma (68 % if calibrated)", 100, "{:.1f} %"),
        "within_2_sigma": ("within 2 sigma (95 % if calibrated)", 100, "{:.1f} %"),
        "nothing_brier": ("Brier score of no surface in range", 1, "{:.3f}"),
        "invented": ("false depth without a surface", 100, "{:.1f} %"),
        "free_brier": ("Brier score of the free corridor", 1, "{:.3f}"),
        "obstacle_error": ("nearest obstacle ahead, error", 100, "{:+.1f} %"),
        "obstacle_missed": ("nearest obstacle missed", 1, "{:.2g}"),
        "obstacle_false": ("false obstacle", 1, "{:.2g}"),
        "free_precision": ("precision of free space", 100, "{:.1f} %"),
        "free_recall": ("recall of free space", 100, "{:.1f} %"),
    },
}
"""Label, factor and format of each figure of image and depth."""
OVER_TIME = {
    "abs_rel": ("error", 100, "{:.1f} %"),
    "within_2_sigma": ("in 2 sigma", 100, "{:.1f} %"),
    "obstacle_m": ("obstacle", 1, "{:.2f} m"),
}
"""The same for a frame of a flight, by depth method."""
MAX_ROWS = 20
"""Maximum number of frames of a flight in a table, evenly chosen from more."""


def written(value: float | None, factor: float = 1, pattern: str = "{:.3f}") -> str:
    """Format a figure times a factor; a dash for None."""
    return "–" if value is None else pattern.format(factor * value)


def compared_methods(metrics: Mapping[str, Any]) -> list[Comparison]:
    """Figures of images and depth maps in rows and methods in columns."""
    return [
        Comparison(
            name,
            [method_title(station, method) for method in metrics[station]],
            [
                (words, *(written(each[key], factor, how) for each in metrics[station].values()))
                for key, (words, factor, how) in FIGURES[station].items()
                if any(each[key] is not None for each in metrics[station].values())
            ],
        )
        for name, station in (("image", "images"), ("depth", "depths"))
        if metrics[station]
    ]


def compared_spots(metrics: Mapping[str, Any], of: str = "") -> list[Comparison]:
    """Spots in rows for each ranging method; ``of`` names the instrument."""
    columns = ("true, m", "measured, m", "error, cm", "sigma, cm", "status")
    return [
        Comparison(
            ", ".join(filter(None, (of, method_title("spots", method)))),
            columns,
            list(map(_spot, count(), spots)),
        )
        for method, spots in metrics["spots"].items()
    ]


def _spot(number: int, spot: Mapping[str, Any]) -> tuple[str, ...]:
    alternatives = (Alternative(**each) for each in spot["alternatives"])
    valid = spot["status"] in RANGED
    measured = written(spot["range_m"]) if valid else no_range(spot["status"], alternatives)
    errors = (written(spot[key], 100, "{:.1f}") for key in ("error_m", "sigma_m"))
    return f"spot {number}", written(spot["true_m"]), measured, *errors, spot["status"]


def compared_flight(comparison: Mapping[str, Any]) -> Comparison:
    """Frames of a flight in rows, the last of means, and figures by depth method in columns."""
    names, frames = comparison["depth_methods"], comparison["over_time"]

    def figures(depths: Mapping[str, Any]) -> list[str]:
        return [
            written(depths.get(name, {}).get(key), factor, how)
            for key, (_, factor, how) in OVER_TIME.items()
            for name in names
        ]

    heads = [f"{head}, {name}" for head, *_ in OVER_TIME.values() for name in names]
    chosen = np.linspace(0, len(frames) - 1, min(len(frames), MAX_ROWS)).round().astype(int)
    rows = [
        [
            written(frame["time_s"], 1, "{:.2f} s"),
            written(frame["image_nrmse"]),
            *figures(frame["depths"]),
            written(frame["corridor_m"], 1, "{:.2f} m"),
        ]
        for frame in (frames[k] for k in chosen)
    ]
    rows.append(["mean", "", *figures(comparison["mean"]), ""])
    return Comparison("time", ["image", *heads, "first surface"], rows)


def ratio_sentences(comparison: Mapping[str, Any]) -> list[str]:
    """The default depth method's error over that of each other one, with its interval."""
    first, sentences = comparison["depth_methods"][0], []
    for name, ratio in comparison["ratio"].items():
        value, low, high = (written(ratio[key]) for key in ("abs_rel", "low", "high"))
        sentences.append(
            f"error of {first} over that of {name}: {value}, 95 % interval {low} to {high}, of "
            f"{ratio['frames']} frames as if independent"
        )
    return sentences
