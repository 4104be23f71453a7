"""What `reconstruction.evaluate` finds, as tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

from reconstruction.evaluation import method_title, no_range
from reconstruction.ranging import RANGED, Alternative


@dataclass(frozen=True)
class Comparison:
    """A table of what is compared; the first cell of each row says what it is."""

    name: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


#: Of image and depth: what each figure is called, times how much it is written, and how.
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
        "within_1_sigma": ("within 1 sigma (68 % is honest)", 100, "{:.1f} %"),
        "within_2_sigma": ("within 2 sigma (95 % is honest)", 100, "{:.1f} %"),
        "nothing_brier": ("Brier score of nothing within reach", 1, "{:.3f}"),
        "invented": ("depth where there is nothing", 100, "{:.1f} %"),
        "free_brier": ("Brier score of the free corridor", 1, "{:.3f}"),
        "obstacle_error": ("nearest obstacle ahead, error", 100, "{:+.1f} %"),
        "obstacle_missed": ("nearest obstacle missed", 1, "{:.2g}"),
        "obstacle_false": ("false obstacle", 1, "{:.2g}"),
        "free_precision": ("of what is told free, free", 100, "{:.1f} %"),
        "free_recall": ("of what is free, told free", 100, "{:.1f} %"),
    },
}


def written(value: float | None, factor: float = 1, pattern: str = "{:.3f}") -> str:
    """A figure times a factor; a dash where there is none."""
    return "–" if value is None else pattern.format(factor * value)


def compared_methods(metrics: Mapping[str, Any]) -> list[Comparison]:
    """Figures of images and depth maps in rows, methods in columns; those that any method has."""
    return [
        Comparison(
            name,
            [method_title(station, method) for method in metrics[station]],
            [
                (
                    words,
                    *(written(each[key], factor, how) for each in metrics[station].values()),
                )
                for key, (words, factor, how) in FIGURES[station].items()
                if any(each[key] is not None for each in metrics[station].values())
            ],
        )
        for name, station in (("image", "images"), ("depth", "depths"))
        if metrics[station]
    ]


def compared_spots(metrics: Mapping[str, Any], of: str = "") -> list[Comparison]:
    """Spots in rows, of each method of ranging; ``of`` which instrument, if that is to be said."""
    columns = ("true, m", "measured, m", "error, cm", "sigma, cm", "status")
    return [
        Comparison(
            ", ".join(filter(None, (of, method_title("spots", method)))),
            columns,
            list(map(_spot, count(), spots)),
        )
        for method, spots in metrics["spots"].items()
    ]


def _spot(position: int, spot: Mapping[str, Any]) -> tuple[str, ...]:
    alternatives = (Alternative(**each) for each in spot["alternatives"])
    valid = spot["status"] in RANGED
    measured = written(spot["range_m"]) if valid else no_range(spot["status"], alternatives)
    errors = (written(spot[key], 100, "{:.1f}") for key in ("error_m", "sigma_m"))
    return f"spot {position}", written(spot["true_m"]), measured, *errors, spot["status"]
