"""The figures by which a study judges a capture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from reconstruction import Capture, Result, evaluate

#: What `reconstruction.evaluate` returns, and `saturated`.
Evaluated = Mapping[str, Any]


@dataclass(frozen=True)
class Metric:
    """One number for a frame, or None where there is none.

    Metrics of the same `quantity` differ by their `method` and are drawn in one plot.
    """

    quantity: str
    unit: str
    method: str
    better: Literal["high", "low", "near zero"]
    meaning: str
    read: Callable[[Evaluated], float | None]

    @property
    def title(self) -> str:
        """Quantity with its unit, as it stands at an axis."""
        return f"{self.quantity}, {self.unit}" if self.unit else self.quantity


def _image_metrics() -> dict[str, Metric]:
    kinds: dict[str, tuple[str, str, Literal["high", "low"], str]] = {
        "correlation": (
            "image correlation",
            "",
            "high",
            "Pearson correlation of the image and the true one",
        ),
        "psnr_db": (
            "image PSNR",
            "dB",
            "high",
            "the true image's peak squared over the mean squared error",
        ),
        "nrmse": ("image NRMSE", "", "low", "RMS error of the image over the RMS of the true one"),
    }
    made = {}
    for key, (quantity, unit, better, meaning) in kinds.items():
        made[f"image_{key}"] = Metric(
            quantity, unit, "matching pursuit", better, meaning, _field("images", "pursuit", key)
        )
        made[f"image_zero_filled_{key}"] = Metric(
            quantity,
            unit,
            "zero-filled",
            better,
            meaning,
            _field("images", "zero-filled", key),
        )
    return made


def _depth_metrics() -> dict[str, Metric]:
    kinds: dict[str, tuple[str, str, str, Literal["high", "low"], str]] = {
        "mae_m": ("mae_m", "mean depth error", "m", "low", "mean absolute error of the depth map"),
        "rmse_m": ("rmse_m", "RMS depth error", "m", "low", "RMS error of the depth map"),
        "median": (
            "median_relative",
            "median depth error, relative",
            "",
            "low",
            "median over the pixels of the absolute error over the true depth",
        ),
        "within_25": (
            "within_25_percent",
            "depth within 25 %",
            "share",
            "high",
            "share of the pixels whose depth is within 25 % of the true one",
        ),
        "coverage": (
            "coverage",
            "pixels with a depth",
            "share",
            "high",
            "share of the pixels, of those where something is hit, that have a depth",
        ),
    }
    methods = {
        "": ("anchored", "anchored on the spots"),
        "nearest_": ("nearest", "nearest spot"),
        "dense_": ("dense", "measured in every pixel"),
    }
    return {
        f"depth_{prefix}{name}": Metric(
            quantity, unit, method, better, meaning, _field("depths", which, key)
        )
        for prefix, (which, method) in methods.items()
        for name, (key, quantity, unit, better, meaning) in kinds.items()
    }


def _field(*keys: str) -> Callable[[Evaluated], float | None]:
    """A number within what `evaluate` returns; None where it or a part around it is missing."""

    def read(evaluated: Evaluated) -> float | None:
        value: Any = evaluated
        for key in keys:
            value = (value or {}).get(key)
        return None if value is None else float(value)

    return read


def _over_spots(key: str, fold: Callable[[list[float]], Any]) -> Callable[[Evaluated], Any]:
    """Fold a value of all spots that have a range; None where none has."""

    def read(evaluated: Evaluated) -> float | None:
        values = [s[key] for s in _spots(evaluated) if s["status"] == "ok" and s[key] is not None]
        return float(fold(values)) if values else None

    return read


def _spots(evaluated: Evaluated) -> list[Any]:
    return next(iter(evaluated["spots"].values()), [])


def _valid_spots(evaluated: Evaluated) -> float | None:
    spots = _spots(evaluated)
    return float(sum(spot["status"] == "ok" for spot in spots)) if spots else None


#: All metrics by the names that a study plan uses.
METRICS: Mapping[str, Metric] = {
    **_image_metrics(),
    "range_bias_m": Metric(
        "range bias",
        "m",
        "",
        "near zero",
        "measured minus true range, mean over the spots that have a range; above zero is too far",
        _over_spots("error_m", np.mean),
    ),
    "range_error_m": Metric(
        "range error",
        "m",
        "",
        "low",
        "absolute difference of measured and true range, mean over the spots that have a range",
        _over_spots("error_m", lambda errors: np.mean(np.abs(errors))),
    ),
    "range_sigma_m": Metric(
        "range sigma",
        "m",
        "",
        "low",
        "standard error that the ranging itself states, RMS over the spots that have a range",
        _over_spots("sigma_m", lambda sigmas: np.sqrt(np.mean(np.square(sigmas)))),
    ),
    "valid_spots": Metric(
        "spots with a range", "of 4", "", "high", "number of spots that have a range", _valid_spots
    ),
    **_depth_metrics(),
    "saturated": Metric(
        "saturated readings",
        "share",
        "",
        "low",
        "share of the single-pixel readings that cannot be used",
        _field("saturated"),
    ),
}


def measure(capture: Capture, results: Sequence[Result]) -> dict[str, float | None]:
    """All metrics of a capture with truth, mean over the results of its frames.

    None where no frame has one.
    """
    assert capture.truth is not None
    frames = []
    for result in results:
        unusable = 1 - float(capture.buckets.usable[result.frame].mean())
        frames.append({**evaluate(result, capture), "saturated": unusable})
    return {name: _mean([metric.read(each) for each in frames]) for name, metric in METRICS.items()}


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
