"""The figures by which a study judges a capture."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, Literal

import numpy as np

from reconstruction import Capture, InputError, Result, evaluate
from reconstruction.capture.readings import READINGS
from reconstruction.errors import naming, nearest
from reconstruction.evaluation import METHODS
from reconstruction.reconstructor import USUAL_DEPTHS, USUAL_IMAGES

#: Methods by station and name.
Methods = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Quantity:
    """One number for what a method makes of a frame, or None where there is none.

    `read` takes it from what `reconstruction.evaluate` tells of one method of the `station`.
    """

    title: str
    unit: str
    station: str
    better: Literal["high", "low", "near zero"]
    meaning: str
    read: Callable[[Any], float | None]

    @property
    def label(self) -> str:
        """With its unit, as it stands at an axis."""
        return f"{self.title}, {self.unit}" if self.unit else self.title


def _over_spots(key: str, fold: Callable[[list[float]], Any]) -> Callable[[Any], float | None]:
    """Fold a value of all spots that have a range; None where none has."""

    def read(spots: Any) -> float | None:
        values = [spot[key] for spot in spots if spot["status"] == "ok" and spot[key] is not None]
        return float(fold(values)) if values else None

    return read


#: Station of what no method makes.
BUCKETS = "buckets"

#: All quantities by the names that a study plan uses.
QUANTITIES: Mapping[str, Quantity] = {
    "image_correlation": Quantity(
        "image correlation",
        "",
        "images",
        "high",
        "Pearson correlation of the image and the true one",
        itemgetter("correlation"),
    ),
    "image_psnr_db": Quantity(
        "image PSNR",
        "dB",
        "images",
        "high",
        "the true image's peak squared over the mean squared error",
        itemgetter("psnr_db"),
    ),
    "image_nrmse": Quantity(
        "image NRMSE",
        "",
        "images",
        "low",
        "RMS error of the image over the RMS of the true one",
        itemgetter("nrmse"),
    ),
    "range_bias_m": Quantity(
        "range bias",
        "m",
        "spots",
        "near zero",
        "measured minus true range, mean over the spots that have a range; above zero is too far",
        _over_spots("error_m", np.mean),
    ),
    "range_error_m": Quantity(
        "range error",
        "m",
        "spots",
        "low",
        "absolute difference of measured and true range, mean over the spots that have a range",
        _over_spots("error_m", lambda errors: np.mean(np.abs(errors))),
    ),
    "range_sigma_m": Quantity(
        "range sigma",
        "m",
        "spots",
        "low",
        "standard error that the ranging itself states, RMS over the spots that have a range",
        _over_spots("sigma_m", lambda sigmas: np.sqrt(np.mean(np.square(sigmas)))),
    ),
    "valid_spots": Quantity(
        "spots with a range",
        "of 4",
        "spots",
        "high",
        "number of spots that have a range",
        lambda spots: float(sum(spot["status"] == "ok" for spot in spots)),
    ),
    "depth_mae_m": Quantity(
        "mean depth error",
        "m",
        "depths",
        "low",
        "mean absolute error of the depth map",
        itemgetter("mae_m"),
    ),
    "depth_rmse_m": Quantity(
        "RMS depth error", "m", "depths", "low", "RMS error of the depth map", itemgetter("rmse_m")
    ),
    "depth_median": Quantity(
        "median depth error, relative",
        "",
        "depths",
        "low",
        "median over the pixels of the absolute error over the true depth",
        itemgetter("median_relative"),
    ),
    "depth_within_25": Quantity(
        "depth within 25 %",
        "share",
        "depths",
        "high",
        "share of the pixels whose depth is within 25 % of the true one",
        itemgetter("within_25_percent"),
    ),
    "depth_coverage": Quantity(
        "pixels with a depth",
        "share",
        "depths",
        "high",
        "share of the pixels, of those where something is hit, that have a depth",
        itemgetter("coverage"),
    ),
    "saturated": Quantity(
        "saturated readings",
        "share",
        BUCKETS,
        "low",
        "share of the single-pixel readings that cannot be used",
        float,
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


def unusual_methods(names: Iterable[str]) -> Methods:
    """Methods that metrics name besides those by which everything is reconstructed anyway."""
    usual = {None, *USUAL_IMAGES, *USUAL_DEPTHS, *READINGS}
    metrics = [Metric.of(name) for name in names]
    return tuple(
        dict.fromkeys(
            (metric.quantity.station, str(metric.method))
            for metric in metrics
            if metric.method not in usual
        )
    )


def measure(capture: Capture, results: Sequence[Result]) -> dict[str, float | None]:
    """All metrics of a capture with truth, mean over the results of its frames.

    None where no frame has one; of methods by name there are those that the results have.
    """
    frames = [_figures(capture, result) for result in results]
    names = dict.fromkeys([*QUANTITIES, *(name for figures in frames for name in figures)])
    return {name: _mean([figures.get(name) for figures in frames]) for name in names}


def _figures(capture: Capture, result: Result) -> dict[str, float | None]:
    unusable = 1 - float(capture.buckets.usable[result.frame].mean())
    evaluated = {**evaluate(result, capture), BUCKETS: {"": unusable}}
    figures: dict[str, float | None] = {}
    for kind, quantity in QUANTITIES.items():
        for method, told in evaluated[quantity.station].items():
            value = quantity.read(told)
            figures.setdefault(kind, value)
            figures[_name(kind, method)] = value
    return figures


def _name(kind: str, method: str) -> str:
    return f"{kind}[{method}]" if method else kind


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
