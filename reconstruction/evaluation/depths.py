"""How good a depth map is, where it says that nothing is, and what a drone would make of it."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats, Mask
from ..depth import DISTANCES_M, MAX_RANGE_M, MIN_FREE, Corridor, nearest_obstacle_m

Figures = dict[str, float | None]

CLOSE = 1.25
"""Ratio of depths up to which one is near the other."""


def depth_metrics(
    depth_m: ArrayLike,
    true_m: ArrayLike,
    *,
    sigma: ArrayLike | None = None,
    no_return: ArrayLike | None = None,
    rays: Floats | None = None,
    free: Floats | None = None,
    min_free: float = MIN_FREE,
) -> Figures:
    """Metrics of depths (..., H, W), nan where there is none, against true ones.

    What is farther than REACH_M counts as nothing. ``sigma`` is the standard deviation of ln
    depth, ``no_return`` the probability of nothing within reach; `obstacle_metrics`, of one map,
    need the ``rays`` (H, W, 3) of its pixels, z = 1, and where it is stated the probability
    ``free`` (K,) that the corridor is free up to each of `DISTANCES_M`. What cannot be told is
    None.

    Over the pixels that have a depth and where something is hit, ``mae_m``, ``rmse_m``,
    ``median_relative``, ``within_25_percent``, and as D. Eigen, C. Puhrsch, R. Fergus (NIPS 2014)
    have them ``abs_rel``, the mean of |d - t| / t, and ``delta_1_25``, the share of pixels where
    max(d / t, t / d) < 1.25. ``coverage`` is the share of the pixels where something is hit that
    have a depth. Of these, ``within_1_sigma`` and ``within_2_sigma`` is the share whose ln depth is
    off by no more: 0.683 and 0.954 of Gaussian errors. See `no_return_metrics` and `free_metrics`
    for the others.
    """
    values, true_values = (np.asarray(each, dtype=np.float64) for each in (depth_m, true_m))
    empty = ~(true_values <= MAX_RANGE_M)
    result = _errors(values, true_values, ~empty, sigma)
    result |= no_return_metrics(values, empty, no_return)
    result |= free_metrics(values, true_values, no_return)
    return result | obstacle_metrics(values, true_values, rays, free, min_free)


def _errors(depth_m: Floats, true_m: Floats, hit: Mask, sigma: ArrayLike | None) -> Figures:
    names = ("mae_m", "rmse_m", "median_relative", "within_25_percent", "abs_rel", "delta_1_25")
    result: Figures = dict.fromkeys((*names, "coverage", "within_1_sigma", "within_2_sigma"))
    finite = np.isfinite(depth_m) & hit
    if hit.any():
        result["coverage"] = number(finite.sum() / hit.sum())
    if not finite.any():
        return result
    depth_m, true_m = depth_m[finite], true_m[finite]
    error = np.abs(depth_m - true_m)
    relative = error / true_m
    ratio = np.maximum(depth_m / true_m, true_m / depth_m)
    result |= {
        "mae_m": number(error.mean()),
        "rmse_m": number(np.sqrt((error**2).mean())),
        "median_relative": number(np.median(relative)),
        "within_25_percent": number((relative < CLOSE - 1).mean()),
        "abs_rel": number(relative.mean()),
        "delta_1_25": number((ratio < CLOSE).mean()),
    }
    if sigma is not None:
        away = np.log(ratio) / np.asarray(sigma, dtype=np.float64)[finite]
        result |= {f"within_{k}_sigma": number((away <= k).mean()) for k in (1, 2)}
    return result


def no_return_metrics(depth_m: Floats, empty: Mask, no_return: ArrayLike | None) -> Figures:
    """How well depths (H, W) tell where it is ``empty`` (H, W), nothing within reach.

    ``nothing_share``: of the pixels where there is nothing. ``nothing_brier``: mean squared
    difference of the probability told and 0 or 1; the share b of a whole set, told of all its
    pixels, has b (1 - b) (G. W. Brier, Mon. Weather Rev. 78, 1 (1950)). ``invented``: share of the
    empty pixels that have a depth within reach.
    """
    result: Figures = {
        "nothing_share": number(empty.mean()),
        "nothing_brier": None,
        "invented": number((depth_m <= MAX_RANGE_M)[empty].mean()) if empty.any() else None,
    }
    if no_return is not None:
        missed = np.asarray(no_return, dtype=np.float64) - empty
        result["nothing_brier"] = number(np.mean(missed**2))
    return result


def free_metrics(depth_m: Floats, true_m: Floats, no_return: ArrayLike | None) -> Figures:
    """Free space before the surfaces, as lengths along the optical axis, summed over pixels.

    What is free in a pixel is all up to its depth, up to REACH_M where there is nothing, and none
    that is told where it is not known. ``free_precision`` is the share of the length told free that
    is free, ``free_recall`` the share of what is free that is told.
    """
    true_free = np.where(true_m <= MAX_RANGE_M, true_m, MAX_RANGE_M)
    stated = np.minimum(np.nan_to_num(depth_m), MAX_RANGE_M)
    if no_return is not None:
        stated = np.where(np.isnan(depth_m) & (np.asarray(no_return) >= 0.5), MAX_RANGE_M, stated)
    both = np.minimum(stated, true_free).sum()
    return {
        "free_precision": number(both / stated.sum()) if stated.any() else None,
        "free_recall": number(both / true_free.sum()),
    }


def obstacle_metrics(
    depth_m: Floats,
    true_m: Floats,
    rays: Floats | None,
    free: Floats | None = None,
    min_free: float = MIN_FREE,
) -> Figures:
    """Nearest obstacle in the corridor ahead: where ``free`` is below ``min_free``, or the map's.

    ``obstacle_error``: relative, above 0 is too far. ``obstacle_missed``: 1 where it is stated
    more than 25 % too far or not at all, else 0; None without one. ``obstacle_false``: 1 where one
    is reported that is more than 25 % too near or not there, else 0. ``free_brier``: mean squared
    difference, over `DISTANCES_M`, of the probability that the corridor is free up to there and 0
    or 1; ``free_bias``: mean difference, above 0 where too much is called free. All are None
    without ``rays``, the latter two without ``free`` (K,).
    """
    if rays is None:
        names = ("obstacle_error", "obstacle_missed", "obstacle_false", "free_brier", "free_bias")
        return dict.fromkeys(names)
    corridor = Corridor(rays)
    true = corridor.nearest_m(true_m)
    estimate = corridor.nearest_m(depth_m) if free is None else nearest_obstacle_m(free, min_free)
    error = estimate / true - 1
    off = None if free is None else free - ~(true <= DISTANCES_M)
    return {
        "obstacle_error": number(error),
        "obstacle_missed": None if np.isnan(true) else float(not error <= CLOSE - 1),
        "obstacle_false": 0.0 if np.isnan(estimate) else float(not error >= 1 - CLOSE),
        "free_brier": None if off is None else number(np.mean(off**2)),
        "free_bias": None if off is None else number(np.mean(off)),
    }


def number(value: Any) -> float | None:
    """A float, None where there is no finite one."""
    return float(value) if np.isfinite(value) else None
