"""Results of `reconstruction.evaluate` as tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

from reconstruction.evaluation import method_title, no_range
from reconstruction.ranging import RANGED, Alternative


@dataclass(frozen=True)
class Comparison:
    """A comparison table; the first cell of each row is its heading."""

    name: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


#: Label, factor and format of each figure of image and depth.
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


def written(value: float | None, factor: float = 1, pattern: str = "{:.3f}") -> str:
    """Format a figure times a factor; a dash for None."""
    return "–" if value is None else pattern.format(factor * value)


def compared_methods(metrics: Mapping[str, Any]) -> list[Comparison]:
    """Return figures of images and depth maps in rows and methods in columns."""
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
    """Return spots in rows for each ranging method; ``of`` names the instrument."""
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
