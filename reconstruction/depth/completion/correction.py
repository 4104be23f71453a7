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
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats
from ..pixels import distances, hats
from .points import Seen

MAX_ANCHORS = 300
ROUNDS = 2
"""Iterations of the weights."""
ROWS = 64
"""Rows of the map whose pixels are the unit of length."""
COARSE_ROWS = 32
"""Rows in which the variance that is left is computed; the others are between them."""
CELLS = (40, 32, 28, 24, 20, 16, 12, 8)
"""Cells along each axis, of which each holds one of too many points."""
MIN_REMAINING = 0.01
SINGLE = np.float32
"""Precision of what is computed for every pixel."""
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
    """Corrects maps (H, W) of one shape; its arrays of pixels by anchors are made once.

    Pages of memory that are new cost more than the exponentials that fill them.
    """

    def __init__(self, shape: tuple[int, int], kernel: Kernel | None = None) -> None:
        self._kernel = kernel or fitted_kernel()
        self._shape, self._unit = shape, ROWS / shape[0]
        self._likeness, self._other = np.empty((2, shape[0] * shape[1] * MAX_ANCHORS), SINGLE)
        self._stride = max(shape[0] // COARSE_ROWS, 1)
        self._to_rows, self._to_columns = (
            hats(np.arange(side) / self._stride, -(-side // self._stride)) for side in shape
        )

    def __call__(self, log_depth: Floats, sigma: Floats, seen: Seen) -> Correction | None:
        """Error of a map of ln depth, by the points in view; None without any."""
        kernel, seen = self._kernel, spread_out(seen, self._shape)
        if not len(seen.index):
            return None
        row, column = np.clip(np.round(seen.pixel), 0, np.array(self._shape) - 1).astype(np.intp).T
        mean, spread = log_depth[row, column], sigma[row, column]
        slopes = np.gradient(log_depth)
        squared_slope = slopes[0][row, column] ** 2 + slopes[1][row, column] ** 2
        noise = (seen.log_variance + np.minimum(squared_slope * seen.pixel_variance, 1)) / spread**2
        apart = self._unit * distances(seen.pixel, seen.pixel)
        covariance = likeness(apart, mean[:, None] - mean, kernel)
        inverse, solved = _robust(covariance, (seen.log_depth - mean) / spread, noise, kernel)
        to_pixels = self._to_pixels(log_depth, seen.pixel, mean)
        error = (to_pixels @ solved).reshape(self._shape) * sigma
        contradiction = spread * solved / np.diagonal(inverse)
        return Correction(error, self._remaining(to_pixels, inverse), seen, contradiction)

    def _to_pixels(self, log_depth: Floats, pixel: Floats, mean: Floats) -> NDArray[np.float32]:
        """Covariance (N, n) of all pixels with the anchors: `likeness`, in place."""
        rows, columns, count = *self._shape, len(mean)
        apart, contrast = (
            each[: rows * columns * count].reshape(rows, columns, count)
            for each in (self._likeness, self._other)
        )
        down, along = (
            (self._unit * (np.arange(side)[:, None] - pixel[:, axis])).astype(SINGLE) ** 2
            for axis, side in enumerate(self._shape)
        )
        np.sqrt(np.add(down[:, None], along, out=apart), out=apart)
        near, wide = apart, contrast
        np.multiply(apart, SINGLE(-1 / self._kernel.smooth_px), out=wide)
        near *= SINGLE(-1 / self._kernel.sharp_px)
        for part, share in ((near, self._kernel.sharp), (wide, self._kernel.smooth)):
            np.exp(part, out=part)
            part *= SINGLE(share)
        near += wide
        np.subtract(log_depth.astype(SINGLE)[..., None], mean.astype(SINGLE), out=contrast)
        contrast *= contrast
        contrast *= SINGLE(-0.5 / self._kernel.edge**2)
        near *= np.exp(contrast, out=contrast)
        return near.reshape(-1, count)

    def _remaining(self, to_pixels: NDArray[np.float32], inverse: NDArray[np.float32]) -> Floats:
        """Fraction of the variance that is left: of some rows and columns, bilinear between."""
        kernel, stride = self._kernel, self._stride
        some = to_pixels.reshape(*self._shape, -1)[::stride, ::stride]
        coarse = some.reshape(-1, len(inverse))
        explained = ((coarse @ inverse) * coarse).sum(axis=1).reshape(some.shape[:2])
        whole = kernel.sharp + kernel.smooth + kernel.nugget
        left = np.clip(1 - explained / whole, MIN_REMAINING, 1)
        return np.asarray(self._to_rows @ left @ self._to_columns.T)


def _robust(
    covariance: Floats, target: Floats, noise: Floats, kernel: Kernel
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Inverse (n, n) of the covariance with noise, and its product with the target (n,)."""
    weights = np.ones(len(target))
    for _ in range(ROUNDS):
        noisy = (covariance + np.diag((kernel.nugget + noise) / weights)).astype(SINGLE)
        lower = _inverse(noisy)
        inverse = np.tril(lower) + np.tril(lower, -1).T
        solved, precision = inverse @ target.astype(SINGLE), np.diagonal(inverse)
        weights = (kernel.freedom + 1) / (kernel.freedom + solved**2 / precision)
    return inverse, solved


@cache
def _blas() -> Any:
    """Controller of the libraries that are loaded at the first call."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas")


def _inverse(matrix: NDArray[np.float32]) -> NDArray[np.float32]:
    """Inverse of a symmetric matrix (n, n), whose lower triangle counts.

    One thread: for so small a matrix two are slower, and wait for each other for up to a second
    where the machine is busy.
    """
    from scipy.linalg.lapack import spotrf, spotri  # slow to load

    with ONE_THREAD, _blas().limit(limits=1):
        return np.asarray(spotri(spotrf(matrix, lower=1)[0], lower=1)[0])


def likeness(apart: Floats, contrast: Floats, kernel: Kernel) -> Floats:
    """Correlated part of the covariance, for distances in pixels and differences of the map."""
    near = kernel.sharp * np.exp(-apart / kernel.sharp_px)
    near += kernel.smooth * np.exp(-apart / kernel.smooth_px)
    return np.asarray(near * np.exp(-(contrast**2) / (2 * kernel.edge**2)))


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
