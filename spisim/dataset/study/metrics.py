"""The metrics by which a study compares captures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from reconstruction import Capture, InputError, Result, evaluate
from reconstruction.base.errors import naming, nearest
from reconstruction.capture import Truth
from reconstruction.evaluation import METHODS
from reconstruction.ranging import RANGED

#: Methods by station and name.
Methods = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Quantity:
    """A figure of merit of what a method makes of a frame: the one called `key` of its `station`.

    `label` is its axis label with the unit.
    """

    station: str
    key: str
    label: str
    better: Literal["high", "low", "near zero"]
    meaning: str


#: All quantities by their names in a study plan.
QUANTITIES: Mapping[str, Quantity] = {
    "image_correlation": Quantity(
        "images",
        "correlation",
        "image correlation",
        "high",
        "Pearson correlation with the true image",
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
        "measured minus true range, mean over the spots with a range; above zero is too far",
    ),
    "range_error_m": Quantity(
        "spots",
        "error_m",
        "range error, m",
        "low",
        "mean absolute error of the range over the spots with a range",
    ),
    "range_rmse_m": Quantity(
        "spots",
        "rmse_m",
        "RMS range error, m",
        "low",
        "RMS error of the range over the spots with a range",
    ),
    "range_within_sigma": Quantity(
        "spots",
        "within_sigma",
        "fraction of ranges within sigma",
        "high",
        "fraction of the ranges whose error is within their sigma; 0.68 if calibrated",
    ),
    "range_sigma_m": Quantity(
        "spots",
        "sigma_m",
        "range sigma, m",
        "low",
        "estimated standard error of the range, RMS over the spots with a range",
    ),
    "valid_spots": Quantity(
        "spots", "valid", "spots with a range", "high", "number of spots with a range"
    ),
    "lost_spots": Quantity(
        "spots", "lost", "spots without a range", "low", "number of spots without a range"
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
        "fraction of depths within 25 %",
        "high",
        "fraction of the pixels whose depth is within 25 % of the true one",
    ),
    "depth_coverage": Quantity(
        "depths",
        "coverage",
        "fraction of pixels with a depth",
        "high",
        "fraction of the pixels on a surface that have a depth",
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
        "fraction of depths within a factor of 1.25",
        "high",
        "fraction of the pixels whose depth is within a factor of 1.25 of the true one",
    ),
    "depth_within_1_sigma": Quantity(
        "depths",
        "within_1_sigma",
        "fraction of ln depths within 1 sigma",
        "high",
        "fraction of the pixels whose ln depth is within sigma; 0.68 if calibrated",
    ),
    "depth_within_2_sigma": Quantity(
        "depths",
        "within_2_sigma",
        "fraction of ln depths within 2 sigma",
        "high",
        "fraction of the pixels whose ln depth is within 2 sigma; 0.95 if calibrated",
    ),
    "nothing_brier": Quantity(
        "depths",
        "nothing_brier",
        "Brier score of no surface",
        "low",
        "mean squared error of the probability that no surface is within the maximum range",
    ),
    "depth_invented": Quantity(
        "depths",
        "invented",
        "fraction of false depths",
        "low",
        "fraction of the pixels without a surface in range that have a depth",
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
        "free corridor, probability minus frequency",
        "near zero",
        "mean probability that the corridor is free up to a distance, minus the frequency",
    ),
    "obstacle_error": Quantity(
        "depths",
        "obstacle_error",
        "error of the nearest obstacle, relative",
        "near zero",
        "reported over true depth of the nearest obstacle ahead, minus 1; above zero is too far",
    ),
    "obstacle_missed": Quantity(
        "depths",
        "obstacle_missed",
        "fraction of missed obstacles",
        "low",
        "fraction of the frames whose nearest obstacle is reported more than 25 % too far, or not",
    ),
    "obstacle_false": Quantity(
        "depths",
        "obstacle_false",
        "fraction of false obstacles",
        "low",
        "fraction of the frames with an obstacle reported more than 25 % too near, or falsely",
    ),
    "free_precision": Quantity(
        "depths",
        "free_precision",
        "precision of free space",
        "high",
        "fraction of the space reported as free, by length along the rays, that is free",
    ),
    "free_recall": Quantity(
        "depths",
        "free_recall",
        "recall of free space",
        "high",
        "fraction of the free space, by length along the rays, that is reported as free",
    ),
    "saturated": Quantity(
        "buckets",
        "saturated",
        "fraction of saturated readings",
        "low",
        "fraction of the single-pixel readings that are unusable",
    ),
}


#: Bins of true depth, each 19 % wider than the one before.
EDGES_M = np.geomspace(0.5, 32.0, 25)
CENTRES_M = np.sqrt(EDGES_M[:-1] * EDGES_M[1:])
#: Pixels needed in a bin of true depth.
MIN_PIXELS = 5

#: Mean estimated depth in each bin, None with too few pixels, by method.
Profile = Mapping[str, Sequence[float | None]]


@dataclass(frozen=True)
class Metric:
    """A quantity of one method's result, or of the default method's."""

    kind: str
    method: str | None

    @property
    def quantity(self) -> Quantity:
        """The quantity."""
        return QUANTITIES[self.kind]

    @classmethod
    def of(cls, name: str) -> Metric:
        """Parse a name as "depth_mae_m" or "depth_mae_m[nearest]". Raises InputError."""
        kind, bracket, method = name.removesuffix("]").partition("[")
        if kind not in QUANTITIES or (bracket and QUANTITIES[kind].station not in METHODS):
            raise InputError(f"unknown metric {name!r}: {nearest(name, QUANTITIES)}")
        if bracket:
            with naming(f"metric {name!r}"):
                METHODS[QUANTITIES[kind].station](method)
        return cls(kind, method if bracket else None)


def named_methods(names: Iterable[str]) -> Methods:
    """Return station and name of every method named by metrics."""
    metrics = [Metric.of(name) for name in names]
    return tuple(
        dict.fromkeys(
            (metric.quantity.station, metric.method)
            for metric in metrics
            if metric.method is not None
        )
    )


def measure(capture: Capture, results: Sequence[Result]) -> dict[str, float | None]:
    """Return all metrics of a capture with truth, mean over the results of its frames.

    A metric is None if no frame has one. Metrics by method are those of the methods in the results.
    """
    frames = [_values(capture, result) for result in results]
    names = dict.fromkeys([*QUANTITIES, *(name for values in frames for name in values)])
    return {name: _mean(values.get(name) for values in frames) for name in names}


def _values(capture: Capture, result: Result) -> dict[str, float | None]:
    evaluated = evaluate(result, capture)
    spots = {method: _spot_values(each) for method, each in evaluated["spots"].items()}
    unusable = 1 - float(capture.buckets.usable[result.frame].mean())
    stations = {**evaluated, "spots": spots, "buckets": {"": {"saturated": unusable}}}
    values: dict[str, float | None] = {}
    for kind, quantity in QUANTITIES.items():
        for method, evaluation in stations[quantity.station].items():
            values.setdefault(kind, evaluation[quantity.key])
            values[f"{kind}[{method}]" if method else kind] = evaluation[quantity.key]
    return values


def _spot_values(spots: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """Average over the spots with a range; None without any."""
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
        "lost": float(len(spots) - len(valid)),
    }


def depth_profile(results: Sequence[Result], truth: Truth) -> Profile:
    """Return the mean estimated depth by true depth, over the pixels of all frames."""
    profiles = {}
    for method in dict.fromkeys(method for result in results for method in result.depths):
        having = [result for result in results if method in result.depths]
        true_m = np.array([truth.at(result.frame).depth_m for result in having])
        profiles[method] = _means(true_m, np.array([result.depths[method] for result in having]))
    return profiles


def _means(true_m: np.ndarray, estimated_m: np.ndarray) -> list[float | None]:
    both = np.isfinite(true_m) & np.isfinite(estimated_m)
    if not both.any():
        return [None] * CENTRES_M.size
    x, y = true_m[both].astype(float), estimated_m[both].astype(float)
    count, _ = np.histogram(x, EDGES_M)
    total, _ = np.histogram(x, EDGES_M, weights=y)
    return [float(s / n) if n >= MIN_PIXELS else None for s, n in zip(total, count, strict=True)]


def _mean(values: Iterable[float | None]) -> float | None:
    available = [value for value in values if value is not None]
    return float(np.mean(available)) if available else None
