"""The figures by which a study judges a capture."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from reconstruction import Capture, InputError, Result, evaluate
from reconstruction.base.errors import naming, nearest
from reconstruction.evaluation import METHODS
from reconstruction.ranging import RANGED

#: Methods by station and name.
Methods = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Quantity:
    """One number for what a method makes of a frame: the one called `key` of its `station`.

    `label` tells it with its unit, as it stands at an axis.
    """

    station: str
    key: str
    label: str
    better: Literal["high", "low", "near zero"]
    meaning: str


#: All quantities by the names that a study plan uses.
QUANTITIES: Mapping[str, Quantity] = {
    "image_correlation": Quantity(
        "images", "correlation", "image correlation", "high", "Pearson's, with the true image"
    ),
    "image_psnr_db": Quantity(
        "images", "psnr_db", "image PSNR, dB", "high", "true peak squared over mean squared error"
    ),
    "image_gain_db": Quantity(
        "images",
        "gain_db",
        "image gain, dB",
        "high",
        "mean squared error of the better of the zero-filled and a flat image, over the image's",
    ),
    "image_nrmse": Quantity(
        "images", "nrmse", "image NRMSE", "low", "RMS error over the RMS of the true image"
    ),
    "range_bias_m": Quantity(
        "spots",
        "bias_m",
        "range bias, m",
        "near zero",
        "measured minus true range, mean over the spots that have a range; above zero is too far",
    ),
    "range_error_m": Quantity(
        "spots",
        "error_m",
        "range error, m",
        "low",
        "absolute difference of measured and true range, mean over the spots that have a range",
    ),
    "range_rmse_m": Quantity(
        "spots",
        "rmse_m",
        "RMS range error, m",
        "low",
        "RMS difference of measured and true range over the spots that have a range",
    ),
    "range_within_sigma": Quantity(
        "spots",
        "within_sigma",
        "ranges within their sigma, share",
        "high",
        "share of the spots with a range whose error is within the stated sigma; 0.68 is honest",
    ),
    "range_sigma_m": Quantity(
        "spots",
        "sigma_m",
        "range sigma, m",
        "low",
        "standard error that the ranging itself states, RMS over the spots that have a range",
    ),
    "valid_spots": Quantity(
        "spots", "valid", "spots with a range, of 4", "high", "number of spots that have a range"
    ),
    "depth_mae_m": Quantity(
        "depths", "mae_m", "mean depth error, m", "low", "mean absolute error of the depth map"
    ),
    "depth_rmse_m": Quantity(
        "depths", "rmse_m", "RMS depth error, m", "low", "RMS error of the depth map"
    ),
    "depth_median": Quantity(
        "depths",
        "median_relative",
        "median depth error, relative",
        "low",
        "median over the pixels of the absolute error over the true depth",
    ),
    "depth_within_25": Quantity(
        "depths",
        "within_25_percent",
        "depth within 25 %, share",
        "high",
        "share of the pixels whose depth is within 25 % of the true one",
    ),
    "depth_coverage": Quantity(
        "depths",
        "coverage",
        "pixels with a depth, share",
        "high",
        "share of the pixels, of those where something is hit, that have a depth",
    ),
    "depth_abs_rel": Quantity(
        "depths",
        "abs_rel",
        "mean depth error, relative",
        "low",
        "mean over the pixels of the absolute error over the true depth",
    ),
    "depth_delta_1_25": Quantity(
        "depths",
        "delta_1_25",
        "depth within a factor of 1.25, share",
        "high",
        "share of the pixels whose depth is within a factor of 1.25 of the true one",
    ),
    "depth_within_1_sigma": Quantity(
        "depths",
        "within_1_sigma",
        "ln depth within 1 sigma, share",
        "high",
        "share of the pixels whose ln depth is within the stated deviation; 0.68 is honest",
    ),
    "depth_within_2_sigma": Quantity(
        "depths",
        "within_2_sigma",
        "ln depth within 2 sigma, share",
        "high",
        "share of the pixels whose ln depth is within twice that; 0.95 is honest",
    ),
    "nothing_brier": Quantity(
        "depths",
        "nothing_brier",
        "Brier score of nothing",
        "low",
        "mean squared error of the probability that there is nothing within reach",
    ),
    "depth_invented": Quantity(
        "depths",
        "invented",
        "depth where nothing is, share",
        "low",
        "share of the pixels without anything within reach that have a depth",
    ),
    "free_brier": Quantity(
        "depths",
        "free_brier",
        "Brier score of the free corridor",
        "low",
        "mean squared error of the probability that the corridor is free up to a distance",
    ),
    "free_bias": Quantity(
        "depths",
        "free_bias",
        "free corridor, probability less frequency",
        "near zero",
        "mean probability that the corridor is free up to a distance, less how often it is",
    ),
    "obstacle_error": Quantity(
        "depths",
        "obstacle_error",
        "nearest obstacle, error, relative",
        "near zero",
        "reported over true depth of the nearest obstacle ahead, less 1; above zero is too far",
    ),
    "obstacle_missed": Quantity(
        "depths",
        "obstacle_missed",
        "missed obstacles, share",
        "low",
        "share of the frames whose nearest obstacle is reported more than 25 % too far, or not",
    ),
    "obstacle_false": Quantity(
        "depths",
        "obstacle_false",
        "false obstacles, share",
        "low",
        "share of the frames with an obstacle reported more than 25 % too near, or without one",
    ),
    "free_precision": Quantity(
        "depths",
        "free_precision",
        "free of what is told free, share",
        "high",
        "share of the space told free, as length before the surfaces, that is free",
    ),
    "free_recall": Quantity(
        "depths",
        "free_recall",
        "told free of what is free, share",
        "high",
        "share of the free space, as length before the surfaces, that is told free",
    ),
    "saturated": Quantity(
        "buckets",
        "saturated",
        "saturated readings, share",
        "low",
        "share of the single-pixel readings that cannot be used",
    ),
}


@dataclass(frozen=True)
class Metric:
    """A quantity of what one method gives; of the default one where none is named."""

    kind: str
    method: str | None

    @property
    def quantity(self) -> Quantity:
        """What it is of."""
        return QUANTITIES[self.kind]

    @classmethod
    def of(cls, name: str) -> Metric:
        """By a name as "depth_mae_m" or "depth_mae_m[nearest]"; InputError for an unknown one."""
        kind, bracket, method = name.removesuffix("]").partition("[")
        if kind not in QUANTITIES or (bracket and QUANTITIES[kind].station not in METHODS):
            raise InputError(f"unknown metric {name!r}: {nearest(name, QUANTITIES)}")
        if bracket:
            with naming(f"metric {name!r}"):
                METHODS[QUANTITIES[kind].station](method)
        return cls(kind, method if bracket else None)


def named_methods(names: Iterable[str]) -> Methods:
    """Station and name of every method that metrics name."""
    metrics = [Metric.of(name) for name in names]
    return tuple(
        dict.fromkeys(
            (metric.quantity.station, metric.method)
            for metric in metrics
            if metric.method is not None
        )
    )


def measure(capture: Capture, results: Sequence[Result]) -> dict[str, float | None]:
    """All metrics of a capture with truth, mean over the results of its frames.

    None where no frame has one; of methods by name there are those that the results have.
    """
    frames = [_figures(capture, result) for result in results]
    names = dict.fromkeys([*QUANTITIES, *(name for figures in frames for name in figures)])
    return {name: _mean(figures.get(name) for figures in frames) for name in names}


def _figures(capture: Capture, result: Result) -> dict[str, float | None]:
    evaluated = evaluate(result, capture)
    spots = {method: _spot_figures(each) for method, each in evaluated["spots"].items()}
    unusable = 1 - float(capture.buckets.usable[result.frame].mean())
    stations = {**evaluated, "spots": spots, "buckets": {"": {"saturated": unusable}}}
    figures: dict[str, float | None] = {}
    for kind, quantity in QUANTITIES.items():
        for method, reported in stations[quantity.station].items():
            figures.setdefault(kind, reported[quantity.key])
            figures[f"{kind}[{method}]" if method else kind] = reported[quantity.key]
    return figures


def _spot_figures(spots: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """Of all spots that have a range; None where none has."""
    valid = [spot for spot in spots if spot["status"] in RANGED]
    errors, sigmas = (
        [spot[key] for spot in valid if spot[key] is not None] for key in ("error_m", "sigma_m")
    )
    return {
        "bias_m": _mean(errors),
        "error_m": _mean(map(abs, errors)),
        "rmse_m": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        "within_sigma": _mean(
            float(abs(spot["error_m"]) <= spot["sigma_m"])
            for spot in valid
            if spot["error_m"] is not None
        ),
        "sigma_m": float(np.sqrt(np.mean(np.square(sigmas)))) if sigmas else None,
        "valid": float(len(valid)),
    }


def _mean(values: Iterable[float | None]) -> float | None:
    available = [value for value in values if value is not None]
    return float(np.mean(available)) if available else None
