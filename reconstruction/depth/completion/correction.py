"""Correction of a depth map by points: a Gaussian process of the map's error.

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
from bisect import bisect_left
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..pixels import hats
from .points import Seen

MAX_ANCHORS = 160
ROUNDS = 2
"""Iterations of the weights."""
ROWS = 64
"""Rows of the map whose pixels are the unit of length."""
COARSE_ROWS = 32
"""Rows in which the variance that is left is computed; the others are between them."""
CELLS = range(40, 7, -1)
"""Cells along each axis, of which each holds one of too many points."""
MIN_REMAINING = 0.01
STEPS = 4
"""Positions to a unit of length that a point's is rounded to."""
CHUNK = 64
"""Points whose covariances with all pixels are computed at a time, to stay in the cache."""
HALVED = 50
"""Half of the smallest triangle that is inverted by halves."""
SINGLE = np.float32
"""Precision of covariances."""
Singles = NDArray[np.float32]
ONE_THREAD = Lock()
"""Held while all of the process does linear algebra with one thread."""
FITTED = Path(__file__).with_name("fitted.json")


@dataclass(frozen=True)
class Kernel:
    """Constants of the process; `tools/flight_memory.py` fits ``sigma_factor`` to flights.

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
def fitted() -> dict[str, Any]:
    """Constants fitted to flights, of the ``kernel`` and of the ``network`` that comes after it."""
    return dict(json.loads(FITTED.read_text()))


def fitted_kernel() -> Kernel:
    """Those of the kernel."""
    return Kernel(**fitted()["kernel"])


class Correction(NamedTuple):
    """Mean (H, W) of the map's error of ln depth, and the fraction of its variance that is left.

    ``points`` are those that it rests on, ``contradiction`` (n,) how much farther each is in ln
    depth than the others predict.
    """

    error: Floats
    remaining: Floats
    points: Seen
    contradiction: Floats


class MapCorrector:
    """Corrects maps (H, W) of one shape; its arrays of anchors by pixels are made once.

    Pages of memory that are new cost more than the exponentials that fill them.
    """

    def __init__(self, shape: tuple[int, int], kernel: Kernel | None = None) -> None:
        self._kernel, self._shape = kernel or fitted_kernel(), shape
        self._by_distance = _ByDistance(self._kernel, shape)
        self._to_pixels = np.empty((MAX_ANCHORS, shape[0] * shape[1]), SINGLE)
        self._stride = max(shape[0] // COARSE_ROWS, 1)
        self._to_rows, self._to_columns = (
            hats(np.arange(side) / self._stride, -(-side // self._stride)) for side in shape
        )

    def __call__(self, log_depth: Floats, sigma: Floats, seen: Seen) -> Correction | None:
        """Error of a map of ln depth, by the points in view; None without any.

        One thread: for so small matrices two are slower, and wait for each other for up to a second
        where the machine is busy.
        """
        if not len(seen.index):
            return None
        with ONE_THREAD, _blas().limit(limits=1):
            return self._correction(log_depth, sigma, spread_out(seen, self._shape))

    def _correction(self, log_depth: Floats, sigma: Floats, seen: Seen) -> Correction:
        kernel = self._kernel
        within = np.clip(seen.pixel, 0, np.array(self._shape) - 1)
        row, column = np.round(within).astype(np.intp).T
        mean, spread = log_depth[row, column], sigma[row, column]
        slopes = np.gradient(log_depth)
        squared_slope = slopes[0][row, column] ** 2 + slopes[1][row, column] ** 2
        noise = (seen.log_variance + np.minimum(squared_slope * seen.pixel_variance, 1)) / spread**2
        places = self._by_distance.places(within)
        covariance = self._by_distance.between(places)
        covariance *= _alike(mean, mean, kernel)
        half, solved = _robust(covariance, (seen.log_depth - mean) / spread, noise, kernel)
        to_pixels = self._to_pixels[: len(mean)]
        for some in (slice(n, n + CHUNK) for n in range(0, len(mean), CHUNK)):
            _alike(mean[some], log_depth.ravel(), kernel, out=to_pixels[some])
            to_pixels[some] *= self._by_distance.to_pixels(places[some])
        error = (solved @ to_pixels).reshape(self._shape) * sigma
        contradiction = spread * solved / _squares(half)
        return Correction(error, self._remaining(to_pixels, half), seen, contradiction)

    def _remaining(self, to_pixels: Singles, half: Singles) -> Floats:
        """Fraction of the variance that is left: in some rows and columns, bilinear between."""
        from scipy.linalg.blas import strmm  # slow to load

        kernel, stride = self._kernel, self._stride
        some = to_pixels.reshape(-1, *self._shape)[:, ::stride, ::stride]
        coarse = some.reshape(len(half), -1)
        explained = _squares(strmm(1, half, coarse.T, side=1, lower=1, trans_a=1).T)
        whole = kernel.sharp + kernel.smooth + kernel.nugget
        left = np.clip(1 - explained.reshape(some.shape[1:]) / whole, MIN_REMAINING, 1)
        return np.asarray(self._to_rows @ left @ self._to_columns.T)


class _ByDistance:
    """Covariance by distance alone, tabulated in `STEPS`."""

    def __init__(self, kernel: Kernel, shape: tuple[int, int]) -> None:
        unit = ROWS / shape[0]
        self._steps = steps = max(round(STEPS * unit), 1)
        self._middle = steps * np.array(shape)
        down, along = (unit / steps * np.arange(-side, side) for side in self._middle)
        self._table = by_distance(np.hypot(down[:, None], along), kernel).astype(SINGLE)
        rows, columns = shape
        phases = self._table.reshape(2 * rows, steps, 2 * columns, steps).transpose(1, 3, 0, 2)
        self._views = sliding_window_view(np.ascontiguousarray(phases), shape, axis=(2, 3))

    def places(self, pixel: Floats) -> NDArray[np.intp]:
        """Positions (n, 2) of pixels in the table's steps."""
        return np.round(self._steps * pixel).astype(np.intp)

    def between(self, places: NDArray[np.intp]) -> Singles:
        """Of positions (n, 2) with each other, (n, n)."""
        number = np.ravel_multi_index(tuple(places.T), self._table.shape)
        middle = np.ravel_multi_index(tuple(self._middle), self._table.shape)
        return self._table.take(number[:, None] - number + middle)

    def to_pixels(self, places: NDArray[np.intp]) -> Singles:
        """Of positions (n, 2) with all pixels, (n, H W)."""
        first = self._middle - places
        (row, column), (down, along) = (first // self._steps).T, (first % self._steps).T
        return np.asarray(self._views[down, along, row, column].reshape(len(places), -1))


def _alike(one: Floats, other: Floats, kernel: Kernel, out: Singles | None = None) -> Singles:
    """Factor (n, m) of the covariance by the difference of ln depths (n,) and (m,)."""
    here, there = (each.astype(SINGLE) * SINGLE(0.5**0.5 / kernel.edge) for each in (one, other))
    out = np.subtract(here[:, None], there, out=out)
    out *= out
    return np.asarray(np.exp(np.negative(out, out=out), out=out))


def _squares(values: Singles) -> Singles:
    """Sums (m,) of squares of columns (n, m)."""
    return np.asarray(np.einsum("ij,ij->j", values, values))


def _robust(
    covariance: Singles, target: Floats, noise: Floats, kernel: Kernel
) -> tuple[Singles, Singles]:
    """Inverse (n, n) of the Cholesky factor of the covariance with noise; its solution (n,)."""
    known, weights = target.astype(SINGLE), np.ones(len(target))
    for _ in range(ROUNDS):
        own = kernel.sharp + kernel.smooth + (kernel.nugget + noise) / weights
        np.fill_diagonal(covariance, own)
        half = _inverse_factor(covariance)
        solved = (half @ known) @ half
        weights = (kernel.freedom + 1) / (kernel.freedom + solved**2 / _squares(half))
    return half, solved.astype(SINGLE)


@cache
def _blas() -> Any:
    """Controller of the libraries that are loaded at the first call."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")


def _inverse_factor(matrix: Singles) -> Singles:
    """Inverse of the lower Cholesky factor of a symmetric matrix (n, n)."""
    from scipy.linalg.lapack import spotrf  # slow to load

    return _inverse_triangle(spotrf(matrix, lower=1)[0])


def _inverse_triangle(lower: Singles) -> Singles:
    """Inverse of a lower triangle (n, n), by halves: twice as fast as LAPACK's."""
    from scipy.linalg.lapack import strtri  # slow to load

    half = len(lower) // 2
    if half < HALVED:
        return np.asarray(strtri(lower, lower=1)[0])
    result = np.zeros_like(lower)
    first, last = (_inverse_triangle(lower[some, some]) for some in (np.s_[:half], np.s_[half:]))
    result[:half, :half], result[half:, half:] = first, last
    result[half:, :half] = -last @ lower[half:, :half] @ first
    return result


def by_distance(apart: Floats, kernel: Kernel) -> Floats:
    """Covariance at distances in pixels, for equal ln depths."""
    sharp = kernel.sharp * np.exp(-apart / kernel.sharp_px)
    return np.asarray(sharp + kernel.smooth * np.exp(-apart / kernel.smooth_px))


def spread_out(seen: Seen, shape: tuple[int, ...]) -> Seen:
    """At most `MAX_ANCHORS` points: the surest of each cell of the image."""
    if len(seen.index) <= MAX_ANCHORS:
        return seen
    order = np.argsort(seen.log_variance + seen.pixel_variance / ROWS**2, kind="stable")
    place = (seen.pixel[order] + 0.5) / shape

    def first(cells: int) -> NDArray[np.intp]:
        row, column = (place * cells).astype(np.intp).T
        return np.unique(row * cells + column, return_index=True)[1]

    fewer = bisect_left(CELLS, True, key=lambda cells: len(first(cells)) <= MAX_ANCHORS)
    return seen[order[first(CELLS[fewer])]]
