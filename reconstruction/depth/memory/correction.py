"""Correction of a depth map by remembered points: a Gaussian process of the map's error.

ln z = m + e, where m is the map of the frame alone, s its standard deviation, and

    cov(e, e') = s s' [a exp(-d / A) + b exp(-d / B) + c delta] exp(-(m - m')² / 2 E²)

with d the distance in pixels of a map of 64 rows, and the constants of a `Kernel`. The last factor
keeps edges: a point corrects what the map has at its depth. A point states m + e with the variance
of its range and pose, plus that of its pixel times the squared slope of the map. Its error has
heavy tails: points that contradict what the others predict, by the leave-one-out residual, get the
weights of Student's t (K. L. Lange, R. J. A. Little, J. M. G. Taylor, J. Am. Stat. Assoc. 84, 881
(1989)).
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from .points import Seen

MAX_ANCHORS = 120
ROUNDS = 3
"""Iterations of the weights."""
ROWS = 64
"""Rows of the map whose pixels are the unit of length."""
CELLS = (32, 24, 16, 12, 8)
"""Cells along each axis, of which each holds one of too many points."""
MIN_REMAINING = 0.01
SINGLE = np.float32
"""Precision of what is computed for every pixel."""
FITTED = Path(__file__).with_name("kernel.json")


@dataclass(frozen=True)
class Kernel:
    """Constants of the process, fitted by `tools/flight_kernel.py`.

    ``sharp`` and ``smooth`` are fractions of the variance that are correlated over ``sharp_px`` and
    ``smooth_px``, ``nugget`` one that is not; ``edge`` is the difference of ln depth that separates
    surfaces, ``freedom`` that of Student's t, and ``sigma_factor`` a factor of the stated sigma.
    """

    sharp: float
    sharp_px: float
    smooth: float
    smooth_px: float
    nugget: float
    edge: float
    freedom: float
    sigma_factor: float


@cache
def fitted_kernel() -> Kernel:
    """Constants fitted to flights."""
    return Kernel(**json.loads(FITTED.read_text())["kernel"])


class Correction(NamedTuple):
    """Mean (H, W) of the map's error of ln depth, and the fraction of its variance that is left."""

    error: Floats
    remaining: Floats


def correction(
    log_depth: Floats, sigma: Floats, seen: Seen, kernel: Kernel | None = None
) -> Correction | None:
    """Error of a map (H, W) of ln depth, by the points in view; None without any."""
    kernel = kernel or fitted_kernel()
    seen = spread_out(seen, log_depth.shape)
    if not len(seen.index):
        return None
    row, column = np.clip(np.round(seen.pixel), 0, np.array(sigma.shape) - 1).astype(np.intp).T
    mean, spread = log_depth[row, column], sigma[row, column]
    slopes = np.gradient(log_depth)
    squared_slope = slopes[0][row, column] ** 2 + slopes[1][row, column] ** 2
    noise = (seen.log_variance + np.minimum(squared_slope * seen.pixel_variance, 1)) / spread**2
    unit = ROWS / len(log_depth)
    apart = unit * np.linalg.norm(seen.pixel[:, None] - seen.pixel, axis=-1)
    covariance = _likeness(apart, mean[:, None] - mean, kernel)
    target, weights = (seen.log_depth - mean) / spread, np.ones(len(row))
    for _ in range(ROUNDS):
        inverse = np.linalg.inv(covariance + np.diag((kernel.nugget + noise) / weights))
        solved, precision = inverse @ target, np.diagonal(inverse)
        weights = (kernel.freedom + 1) / (kernel.freedom + solved**2 / precision)
    to_pixels = _likeness(*_to_pixels(log_depth, seen.pixel, mean), kernel)
    explained = ((to_pixels @ inverse.astype(SINGLE)) * to_pixels).sum(axis=1)
    whole = kernel.sharp + kernel.smooth + kernel.nugget
    return Correction(
        (to_pixels @ solved.astype(SINGLE)).reshape(sigma.shape) * sigma,
        np.clip(1 - explained / whole, MIN_REMAINING, 1).reshape(sigma.shape),
    )


def _to_pixels(
    log_depth: Floats, pixel: Floats, mean: Floats
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Distances of all pixels from the points, and contrasts of the map, (N, n) each, as single."""
    unit = ROWS / len(log_depth)
    rows, columns = (np.arange(side) for side in log_depth.shape)
    down = (unit * (rows[:, None] - pixel[:, 0])).astype(SINGLE) ** 2
    along = (unit * (columns[:, None] - pixel[:, 1])).astype(SINGLE) ** 2
    apart = np.sqrt(down[:, None] + along).reshape(-1, len(mean))
    return apart, log_depth.astype(SINGLE).reshape(-1, 1) - mean.astype(SINGLE)


def _likeness(apart: NDArray[Any], contrast: NDArray[Any], kernel: Kernel) -> NDArray[Any]:
    near = np.exp(apart * (-1 / kernel.sharp_px))
    near *= kernel.sharp
    wide = np.exp(apart * (-1 / kernel.smooth_px))
    wide *= kernel.smooth
    near += wide
    near *= np.exp(contrast**2 * (-0.5 / kernel.edge**2))
    return near


def spread_out(seen: Seen, shape: tuple[int, ...]) -> Seen:
    """At most `MAX_ANCHORS` points: the surest of each cell of the image."""
    if len(seen.index) <= MAX_ANCHORS:
        return seen
    order = np.argsort(seen.log_variance + seen.pixel_variance / ROWS**2, kind="stable")
    for cells in CELLS:
        cell = np.floor((seen.pixel[order] + 0.5) * (cells / np.array(shape))).astype(np.intp)
        _, first = np.unique(cell[:, 0] * cells + cell[:, 1], return_index=True)
        if len(first) <= MAX_ANCHORS:
            break
    return seen[order[first]]
