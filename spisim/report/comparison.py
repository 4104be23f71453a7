"""What `reconstruction.evaluate` finds, as tables."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

from reconstruction.evaluation import method_title

from .page import number


@dataclass(frozen=True)
class Comparison:
    """A table of what is compared; the first cell of each row says what it is."""

    name: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]


def percent(share: float | None) -> str:
    """A share; a dash where there is none."""
    return "–" if share is None else f"{100 * share:.1f} %"


def three_digits(value: float | None) -> str:
    """With three decimal places; a dash where there is none."""
    return number(value, 3)


def centimetres(metres: float | None) -> str:
    """A length in them; a dash where there is none."""
    return number(None if metres is None else 100 * metres, 1)


#: Of image and depth: what each figure is called and how it is written.
FIGURES: Mapping[str, Mapping[str, tuple[str, Callable[[float | None], str]]]] = {
    "images": {
        "correlation": ("correlation", three_digits),
        "nrmse": ("RMS error over RMS of the truth", three_digits),
        "psnr_db": ("PSNR, dB", three_digits),
    },
    "depths": {
        "mae_m": ("mean error, m", three_digits),
        "rmse_m": ("RMS error, m", three_digits),
        "median_relative": ("median error", percent),
        "within_25_percent": ("within 25 % of truth", percent),
        "coverage": ("pixels with a value", percent),
    },
}


def compared_methods(metrics: Mapping[str, Any]) -> list[Comparison]:
    """Figures of images and depth maps in rows, methods in columns."""
    return [
        Comparison(
            name,
            [method_title(station, method) for method in metrics[station]],
            [
                (words, *(written(figures[key]) for figures in metrics[station].values()))
                for key, (words, written) in FIGURES[station].items()
            ],
        )
        for name, station in (("image", "images"), ("depth", "depths"))
        if metrics[station]
    ]


def compared_spots(metrics: Mapping[str, Any]) -> list[Comparison]:
    """Spots in rows, of each method of ranging."""
    columns = ("true, m", "measured, m", "error, cm", "sigma, cm")
    return [
        Comparison(method_title("spots", method), columns, list(map(_spot, count(), spots)))
        for method, spots in metrics["spots"].items()
    ]


def _spot(place: int, spot: Mapping[str, Any]) -> tuple[str, ...]:
    measured = three_digits(spot["range_m"]) if spot["status"] == "ok" else spot["status"]
    errors = centimetres(spot["error_m"]), centimetres(spot["sigma_m"])
    return f"spot {place}", three_digits(spot["true_m"]), measured, *errors
