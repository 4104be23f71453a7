"""What a design can be for; the smaller, the better.

Errors of ranges spread over decades, from millimetres near by to none at all in fog. Their
geometric mean weighs a relative gain of all spots alike, and a spot without a range, or with one
that is wrong by more, counts as an error of `LIMIT_M`: an instrument gains nothing by giving up.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_inverse.design.sampling import BOUNDS, IMAGES, RANGES, Sample

LIMIT_M = 0.3
"""Error of a range that is as bad as none."""
LEAST_M = 1e-5
"""Smallest error: the logarithm of none is infinite."""


class Objective(NamedTuple):
    """A figure (of the samples in one weather) that a search makes small."""

    title: str
    unit: str
    samples: str  # what it needs
    of: Callable[[Sequence[Sample]], float]


def range_errors_m(samples: Sequence[Sample]) -> Floats:
    """Absolute errors of all spots that count, at most `LIMIT_M`, which also stands for none."""
    errors = [np.abs(each.error_m[:, each.counts]).ravel() for each in samples]
    joined = np.concatenate(errors) if errors else np.zeros(0)
    return np.minimum(np.nan_to_num(joined, nan=LIMIT_M), LIMIT_M)


def range_bounds_m(samples: Sequence[Sample]) -> Floats:
    """Bounds of all spots that count, at most `LIMIT_M`."""
    bounds = [each.bound_m[each.counts] for each in samples if each.counts.any()]
    return np.minimum(np.concatenate(bounds), LIMIT_M) if bounds else np.zeros(0)


def _geometric(values: Floats) -> float:
    if not values.size:
        return np.nan
    return float(np.exp(np.log(np.maximum(values, LEAST_M)).mean()))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def _missing(errors_m: Floats) -> float:
    """Fraction at the limit, with half a spot more, as none of few is not none of all."""
    if not errors_m.size:
        return np.nan
    return (np.count_nonzero(errors_m >= LIMIT_M) + 0.5) / (errors_m.size + 1)


OBJECTIVES = {
    "range_error_m": Objective(
        "typical error of ranges, geometric mean",
        "m",
        RANGES,
        lambda samples: _geometric(range_errors_m(samples)),
    ),
    "range_rmse_m": Objective(
        "rms error of ranges, those missing as 0.3 m",
        "m",
        RANGES,
        lambda samples: _rms(range_errors_m(samples)),
    ),
    "range_missing": Objective(
        "fraction of spots without a right range",
        "",
        RANGES,
        lambda samples: _missing(range_errors_m(samples)),
    ),
    "range_bound_m": Objective(
        "Cramér–Rao bound of ranges, geometric mean",
        "m",
        BOUNDS,
        lambda samples: _geometric(range_bounds_m(samples)),
    ),
    "image_nrmse": Objective(
        "rms error of the image over its rms",
        "",
        IMAGES,
        lambda samples: _rms(np.concatenate([each.image_nrmse for each in samples])),
    ),
}
"""The objectives by name."""


def over_weathers(name: str, samples: Sequence[Sample]) -> dict[str, float]:
    """An objective in each weather."""
    of = OBJECTIVES[name].of
    weathers = dict.fromkeys(each.weather for each in samples)
    return {
        weather: of([each for each in samples if each.weather == weather]) for weather in weathers
    }


def figure(by_weather: dict[str, float]) -> float:
    """All weathers in one figure, their geometric mean."""
    return float(np.exp(np.mean(np.log(list(by_weather.values())))))
