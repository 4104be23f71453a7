"""Metrics of depth maps, of their probability of no return, and of the corridor ahead."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.arrays import Floats, Mask
from ..depth import DISTANCES_M, MAX_RANGE_M, MIN_FREE, Corridor, nearest_obstacle_m

Figures = dict[str, float | None]

CLOSE = 1.25
"""Ratio of depths up to which one is close to the other."""


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
    """Metrics of depth maps; those that are undefined are None.

    Over pixels with a depth and a true surface: ``mae_m``, ``rmse_m``, ``median_relative``,
    ``within_25_percent``, and as defined by D. Eigen, C. Puhrsch, R. Fergus (NIPS 2014)
    ``abs_rel``, the mean of |d - t| / t, and ``delta_1_25``, the fraction with max(d / t, t / d) <
    1.25. ``coverage`` is the fraction of true surfaces that have a depth; ``within_1_sigma`` and
    ``within_2_sigma`` are the fractions of these whose ln depth has no larger error, 0.683 and
    0.954 for Gaussian errors. See `no_return_metrics`, `free_metrics` and `obstacle_metrics` for
    the others.

    Parameters
    ----------
    depth_m, true_m
        Depths (..., H, W) in metres, nan for none; beyond MAX_RANGE_M there is no return.
    sigma
        Standard deviation of ln depth.
    no_return
        Probability that there is nothing within MAX_RANGE_M.
    rays
        Rays (H, W, 3) of the pixels, z = 1; needed, for one map, by `obstacle_metrics`.
    free
        Stated probability (K,) that the corridor is free up to each of `DISTANCES_M`.
    min_free
        Probability below which the corridor counts as blocked.

    Returns
    -------
    dict
        Metrics by name.
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
    """Metrics of where depths (..., H, W) have no return, against the mask ``empty``.

    ``nothing_share``: fraction of empty pixels. ``nothing_brier``: mean squared difference of the
    probability and 0 or 1; a constant probability equal to the fraction b scores b (1 - b) (G. W.
    Brier, Mon. Weather Rev. 78, 1 (1950)). ``invented``: fraction of the empty pixels with a depth
    within the maximum range.
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
    """Free space in front of surfaces, as lengths along the optical axis, summed over pixels.

    A pixel is free up to its depth, up to MAX_RANGE_M if it has no return, and nowhere if it is
    unknown. ``free_precision``: fraction of the estimated length that is free; ``free_recall``:
    fraction of the free length that is estimated.
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
    """Metrics of the nearest obstacle: where ``free`` is below ``min_free``, or of the map.

    ``obstacle_error``: relative, positive if too far. ``obstacle_missed``: 1 if it is reported more
    than 25 % too far or not at all, else 0; None without one. ``obstacle_false``: 1 if one is
    reported that is more than 25 % too near or absent, else 0. ``free_brier``: mean squared
    difference, over `DISTANCES_M`, of ``free`` (K,) and 0 or 1; ``free_bias``: mean difference,
    positive if too much is called free. All are None without ``rays``, the last two without
    ``free``.
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
    """Value as a float for JSON, None unless it is finite."""
    return float(value) if np.isfinite(value) else None
